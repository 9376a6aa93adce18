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
        metrics=rules.evaluate_surrogate.output.metrics,
        weights=rules.train_surrogate.output.weights,
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
        metrics=rules.evaluate_surrogate.output.metrics,
        summary=rules.evaluate_surrogate.output.summary,
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
        history=rules.train_surrogate.output.history,
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
