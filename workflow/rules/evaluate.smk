"""How good every model is on held-out simulations."""


rule evaluate_model:
    """Errors of fields and bulk statistics, of a model on a set."""
    input:
        stack=lambda wildcards: (
            rules.build_stack.output.stack
            if wildcards.set == "test"
            else expand(rules.stack_further.output.stack, set=wildcards.set)[0]
        ),
        moulds=lambda wildcards: (
            rules.sample_design.output.moulds
            if wildcards.set == "test"
            else expand(rules.design_further.output.moulds, set=wildcards.set)[0]
        ),
        weights=rules.assemble_model.output.weights,
        model=rules.assemble_model.output.model,
    output:
        metrics=f"{RESULTS}/evaluation/{{model}}/sets/{{set}}.csv",
    log:
        f"{RESULTS}/logs/evaluate_model/{{model}}/{{set}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/evaluate_model/{{model}}/{{set}}.tsv"
    wildcard_constraints:
        model="|".join(MODELS),
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
        metrics=f"{RESULTS}/evaluation/{{model}}/sets/test.csv",
    log:
        f"{RESULTS}/logs/evaluate_baseline/{{model}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/evaluate_baseline/{{model}}.tsv"
    wildcard_constraints:
        model="|".join(BASELINES),
    threads: 1
    resources:
        mem_mb=2500,
    params:
        layers=CONFIG.model.layers,
    script:
        "../scripts/evaluate_baseline.py"


rule summarise_evaluation:
    """A model's errors on the test split, by region, on further sets, and in multiples of the floor."""
    input:
        metrics=lambda wildcards: expand(
            f"{RESULTS}/evaluation/{{model}}/sets/{{set}}.csv",
            set=JUDGED if wildcards.model in MODELS else ["test"],
            allow_missing=True,
        ),
        floor=rules.measure_floor.output.floor,
    output:
        metrics=report(
            f"{RESULTS}/evaluation/{{model}}/metrics.csv",
            caption="../report/metrics.rst",
            category="Surrogate",
            labels={"model": "{model}", "what": "errors, sample by sample"},
        ),
        summary=report(
            f"{RESULTS}/evaluation/{{model}}/metrics.json",
            caption="../report/metrics.rst",
            category="Surrogate",
            labels={"model": "{model}", "what": "errors"},
        ),
        regions=report(
            f"{RESULTS}/evaluation/{{model}}/regions.csv",
            caption="../report/regions.rst",
            category="Surrogate",
            labels={"model": "{model}", "what": "errors by region"},
        ),
    log:
        f"{RESULTS}/logs/summarise_evaluation/{{model}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/summarise_evaluation/{{model}}.tsv"
    threads: 1
    resources:
        mem_mb=800,
    script:
        "../scripts/summarise_evaluation.py"


# The errors of the model by which tissues are fitted and drawn.
ERRORS = {
    name: expand(rules.summarise_evaluation.output[name], model=CONFIG.chosen_model)[0]
    for name in ("metrics", "summary", "regions")
}


rule compare_models:
    """Every model in one table: what it costs, and its errors in multiples of the noise floor."""
    input:
        summaries=expand(
            rules.summarise_evaluation.output.summary, model=[*MODELS, *BASELINES]
        ),
        regions=expand(rules.summarise_evaluation.output.regions, model=MODELS),
        weights=expand(rules.assemble_model.output.weights, model=MODELS),
        histories=expand(rules.assemble_model.output.history, model=MODELS),
    output:
        table=report(
            f"{RESULTS}/evaluation/models.csv",
            caption="../report/models.rst",
            category="Surrogate",
        ),
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
    script:
        "../scripts/compare_models.py"


rule evaluate:
    """The errors of every model."""
    input:
        list(ERRORS.values()),
        rules.compare_models.output,
        rules.measure_floor.output,
        f"{RESULTS}/shipped/card.md",


rule ship:
    """The surrogate as the package ships it: weights in half precision, and a model card."""
    input:
        weights=SURROGATE["weights"],
        model=SURROGATE["model"],
        history=SURROGATE["history"],
        summary=ERRORS["summary"],
        regions=ERRORS["regions"],
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
        model=CONFIG.chosen_model,
    script:
        "../scripts/ship_model.py"
