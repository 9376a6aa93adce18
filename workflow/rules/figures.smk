"""Every figure, with the data that it draws beside it."""


rule plot_design:
    """Distributions of parameters and moulds."""
    input:
        design=rules.sample_design.output.design,
        moulds=rules.sample_design.output.moulds,
    output:
        png=report(
            f"{RESULTS}/figures/design.png",
            caption="../report/plot_design.rst",
            category="Data set",
        ),
        svg=f"{RESULTS}/figures/design.svg",
        data=f"{RESULTS}/figures/design.csv",
    log:
        f"{RESULTS}/logs/plot_design.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_design.tsv"
    threads: 1
    resources:
        mem_mb=800,
    script:
        "../scripts/plot_design.py"


rule plot_fields:
    """The paper's figure: eight fields of a held-out mould, simulation beside prediction."""
    input:
        stack=rules.build_stack.output.stack,
        moulds=rules.sample_design.output.moulds,
        metrics=ERRORS["metrics"],
        weights=SURROGATE["weights"],
    output:
        png=report(
            f"{RESULTS}/figures/fields.png",
            caption="../report/plot_fields.rst",
            category="Surrogate",
        ),
        svg=f"{RESULTS}/figures/fields.svg",
        data=f"{RESULTS}/figures/fields.nc",
    log:
        f"{RESULTS}/logs/plot_fields.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_fields.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    script:
        "../scripts/plot_fields.py"


rule plot_bulk:
    """The paper's figure: eight bulk statistics, predicted against simulated."""
    input:
        metrics=ERRORS["metrics"],
        summary=ERRORS["summary"],
    output:
        png=report(
            f"{RESULTS}/figures/bulk.png",
            caption="../report/plot_bulk.rst",
            category="Surrogate",
        ),
        svg=f"{RESULTS}/figures/bulk.svg",
        data=f"{RESULTS}/figures/bulk.csv",
    log:
        f"{RESULTS}/logs/plot_bulk.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_bulk.tsv"
    threads: 1
    resources:
        mem_mb=800,
    script:
        "../scripts/plot_bulk.py"


rule plot_training:
    """Losses and validation error, epoch by epoch."""
    input:
        history=SURROGATE["history"],
    output:
        png=report(
            f"{RESULTS}/figures/training.png",
            caption="../report/plot_training.rst",
            category="Surrogate",
        ),
        svg=f"{RESULTS}/figures/training.svg",
        data=f"{RESULTS}/figures/training.csv",
    log:
        f"{RESULTS}/logs/plot_training.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_training.tsv"
    threads: 1
    resources:
        mem_mb=800,
    script:
        "../scripts/plot_training.py"


rule plot_calibration:
    """Whether bands hold what they promise."""
    input:
        metrics=ERRORS["metrics"],
        summary=ERRORS["summary"],
    output:
        png=report(
            f"{RESULTS}/figures/calibration.png",
            caption="../report/plot_calibration.rst",
            category="Surrogate",
        ),
        svg=f"{RESULTS}/figures/calibration.svg",
        data=f"{RESULTS}/figures/calibration.csv",
    log:
        f"{RESULTS}/logs/plot_calibration.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_calibration.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    script:
        "../scripts/plot_calibration.py"


rule plot_regions:
    """Errors by region of the parameters, and on further sets."""
    input:
        metrics=ERRORS["metrics"],
        regions=ERRORS["regions"],
    output:
        png=report(
            f"{RESULTS}/figures/regions.png",
            caption="../report/plot_regions.rst",
            category="Surrogate",
        ),
        svg=f"{RESULTS}/figures/regions.svg",
        data=f"{RESULTS}/figures/regions.csv",
    log:
        f"{RESULTS}/logs/plot_regions.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_regions.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    script:
        "../scripts/plot_regions.py"


rule plot_worst:
    """The twelve held-out cases whose density is predicted worst."""
    input:
        stack=rules.build_stack.output.stack,
        moulds=rules.sample_design.output.moulds,
        metrics=ERRORS["metrics"],
        weights=SURROGATE["weights"],
    output:
        png=report(
            f"{RESULTS}/figures/worst.png",
            caption="../report/plot_worst.rst",
            category="Surrogate",
        ),
        svg=f"{RESULTS}/figures/worst.svg",
        data=f"{RESULTS}/figures/worst.nc",
    log:
        f"{RESULTS}/logs/plot_worst.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_worst.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    script:
        "../scripts/plot_worst.py"


rule plot_models:
    """Every model: training, cost, and errors in multiples of the noise floor."""
    input:
        table=rules.compare_models.output.table,
        histories=expand(rules.assemble_model.output.history, model=MODELS),
    output:
        png=report(
            f"{RESULTS}/figures/models.png",
            caption="../report/plot_models.rst",
            category="Surrogate",
        ),
        svg=f"{RESULTS}/figures/models.svg",
        data=f"{RESULTS}/figures/models.csv",
    log:
        f"{RESULTS}/logs/plot_models.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_models.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    script:
        "../scripts/plot_models.py"


rule plot_enrichment:
    """What further simulations were worth in training: errors by region, before and after."""
    input:
        regions=rules.compare_models.output.regions,
    output:
        png=report(
            f"{RESULTS}/figures/enrichment.png",
            caption="../report/plot_enrichment.rst",
            category="Surrogate",
        ),
        svg=f"{RESULTS}/figures/enrichment.svg",
        data=f"{RESULTS}/figures/enrichment.csv",
    log:
        f"{RESULTS}/logs/plot_enrichment.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_enrichment.tsv"
    threads: 1
    resources:
        mem_mb=800,
    params:
        models=[CONFIG.surrogate.model, *ENRICHED],
    script:
        "../scripts/plot_enrichment.py"


rule plot_tradeoff:
    """Error against cost, by method."""
    input:
        table=rules.tabulate_tradeoff.output.table,
    output:
        png=report(
            f"{RESULTS}/figures/tradeoff.png",
            caption="../report/plot_tradeoff.rst",
            category="Trade-off",
        ),
        svg=f"{RESULTS}/figures/tradeoff.svg",
        data=f"{RESULTS}/figures/tradeoff.csv",
    log:
        f"{RESULTS}/logs/plot_tradeoff.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_tradeoff.tsv"
    threads: 1
    resources:
        mem_mb=800,
    script:
        "../scripts/plot_tradeoff.py"


rule figures:
    """Every figure."""
    input:
        expand(f"{RESULTS}/figures/{{figure}}.png", figure=FIGURES),
        expand(rules.plot_fit.output.png, tissue=CONFIG.fit.tissues),
        expand(rules.plot_valley.output.png, tissue=CONFIG.fit.tissues),
        rules.sweep.input,
