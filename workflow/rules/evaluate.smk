"""How good every model is on held-out simulations."""


rule evaluate_model:
    """Errors of fields and bulk statistics, of a model on a set."""
    input:
        stack=lambda wildcards: (
            rules.build_stack.output.stack
            if wildcards.set == "test"
            else expand(rules.stack_further.output.stack, set=wildcards.set)
        ),
        moulds=lambda wildcards: (
            rules.sample_design.output.moulds
            if wildcards.set == "test"
            else expand(rules.design_further.output.moulds, set=wildcards.set)
        ),
        weights=rules.assemble_model.output.weights,
        model=rules.assemble_model.output.model,
    output:
        metrics=f"{RESULTS}/evaluation/{{model}}/{{set}}.csv",
    log:
        f"{RESULTS}/logs/evaluate_model/{{model}}/{{set}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/evaluate_model/{{model}}/{{set}}.tsv"
    threads: 1
    resources:
        mem_mb=2500,
    script:
        "../scripts/evaluate_model.py"


rule evaluate_baseline:
    """Errors of what has no network: the nearest training example, and the training mean."""
    input:
        stack=rules.build_stack.output.stack,
        moulds=rules.sample_design.output.moulds,
        examples=rules.augment_dataset.output.examples,
    output:
        metrics=f"{RESULTS}/evaluation/baselines/{{model}}.csv",
    log:
        f"{RESULTS}/logs/evaluate_baseline/{{model}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/evaluate_baseline/{{model}}.tsv"
    threads: 1
    resources:
        mem_mb=2500,
    params:
        layers=CONFIG.model.layers,
    script:
        "../scripts/evaluate_baseline.py"


rule compare_models:
    """Every model in one table: what it costs, and its errors in multiples of the noise floor."""
    input:
        metrics=[
            *expand(rules.evaluate_model.output.metrics, model=MODELS, set="test"),
            *expand(rules.evaluate_baseline.output.metrics, model=BASELINES),
        ],
        judged=expand(rules.evaluate_model.output.metrics, model=MODELS, set=JUDGED),
        weights=expand(rules.assemble_model.output.weights, model=MODELS),
        histories=expand(rules.assemble_model.output.history, model=MODELS),
        floor=rules.measure_floor.output.floor,
    output:
        table=report(
            f"{RESULTS}/evaluation/models.csv",
            caption="../report/models.rst",
            category="Surrogate",
        ),
        summary=f"{RESULTS}/evaluation/models.json",
        regions=report(
            f"{RESULTS}/evaluation/models_by_region.csv",
            caption="../report/models_by_region.rst",
            category="Surrogate",
        ),
    log:
        f"{RESULTS}/logs/compare_models.log",
    benchmark:
        f"{RESULTS}/benchmarks/compare_models.tsv"
    threads: 2
    resources:
        mem_mb=2500,
    params:
        names=[*MODELS, *BASELINES],
    script:
        "../scripts/compare_models.py"


rule summarise_evaluation:
    """The surrogate's errors on the test split, by region, on further sets, and the noise floor."""
    input:
        metrics=expand(
            rules.evaluate_model.output.metrics,
            model=CONFIG.surrogate.model,
            set=JUDGED,
        ),
        floor=rules.measure_floor.output.floor,
    output:
        metrics=report(
            f"{RESULTS}/evaluation/metrics.csv",
            caption="../report/metrics.rst",
            category="Surrogate",
        ),
        summary=report(
            f"{RESULTS}/evaluation/metrics.json",
            caption="../report/metrics.rst",
            category="Surrogate",
        ),
        regions=report(
            f"{RESULTS}/evaluation/regions.csv",
            caption="../report/regions.rst",
            category="Surrogate",
        ),
    log:
        f"{RESULTS}/logs/summarise_evaluation.log",
    benchmark:
        f"{RESULTS}/benchmarks/summarise_evaluation.tsv"
    threads: 1
    resources:
        mem_mb=800,
    script:
        "../scripts/summarise_evaluation.py"


rule evaluate:
    """The errors of every model."""
    input:
        rules.summarise_evaluation.output,
        rules.compare_models.output,
        rules.measure_floor.output,
        f"{RESULTS}/shipped/card.md",


rule ship:
    """The surrogate as the package ships it: weights in half precision, and a model card."""
    input:
        weights=SURROGATE["weights"],
        model=SURROGATE["model"],
        history=SURROGATE["history"],
        summary=rules.summarise_evaluation.output.summary,
        regions=rules.summarise_evaluation.output.regions,
    output:
        weights=f"{RESULTS}/shipped/weights.safetensors",
        model=f"{RESULTS}/shipped/model.json",
        card=report(
            f"{RESULTS}/shipped/card.md",
            caption="../report/model_card.rst",
            category="Surrogate",
        ),
    log:
        f"{RESULTS}/logs/ship.log",
    benchmark:
        f"{RESULTS}/benchmarks/ship.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    params:
        name=CONFIG.name,
        model=CONFIG.surrogate.model,
    script:
        "../scripts/ship_model.py"
