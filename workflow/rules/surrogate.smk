"""Surrogates: training, and errors on held-out simulations."""

# The campaign of figures.
MAIN = [CONFIG.main_campaign] if MODELS else []
# Campaigns with test runs of their own that models learn from: baselines are for these.
LEARNT = [name for name in CONFIG.tested if name in CONFIG.learnt]
# The repeats of each campaign.
REPEATS = {
    name: [other for other, block in CAMPAIGNS.items() if block.repeat_of == name]
    for name in CAMPAIGNS
}


rule fit_scaling:
    """Scale fields to [-1, 1] by the training splits of a model's campaigns."""
    input:
        stacks=lambda wildcards: expand(
            rules.build_stack.output.stack,
            campaign=CONFIG.origin(wildcards.model).campaigns,
        ),
    output:
        normalisation=f"{RESULTS}/surrogate/{{model}}/normalisation.json",
    log:
        f"{RESULTS}/logs/fit_scaling/{{model}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/fit_scaling/{{model}}.tsv"
    wildcard_constraints:
        model="|".join(MODELS) or "none",
    threads: 1
    resources:
        mem_mb=1000,
    params:
        fraction=lambda wildcards: CONFIG.origin(wildcards.model).training_fraction,
    script:
        "../scripts/fit_scaling.py"


rule train_member:
    """Train one network of a model; resumes from its checkpoint after an interruption."""
    input:
        stacks=lambda wildcards: expand(
            rules.build_stack.output.stack, campaign=MODELS[wildcards.model].campaigns
        ),
        moulds=lambda wildcards: expand(
            rules.design_campaign.output.moulds,
            campaign=MODELS[wildcards.model].campaigns,
        ),
        examples=lambda wildcards: expand(
            rules.list_examples.output.examples,
            campaign=MODELS[wildcards.model].campaigns,
        ),
        checked=lambda wildcards: expand(
            rules.check_campaign.output.checked,
            campaign=MODELS[wildcards.model].campaigns,
        ),
        initial=lambda wildcards: expand(
            f"{RESULTS}/surrogate/{{model}}/members/{{member}}/weights.safetensors",
            model=MODELS[wildcards.model].initial_weights or [],
            member=wildcards.member,
        ),
        normalisation=rules.fit_scaling.output.normalisation,
    output:
        weights=f"{RESULTS}/surrogate/{{model}}/members/{{member}}/weights.safetensors",
        model=f"{RESULTS}/surrogate/{{model}}/members/{{member}}/model.json",
        history=f"{RESULTS}/surrogate/{{model}}/members/{{member}}/training.csv",
    log:
        f"{RESULTS}/logs/train_member/{{model}}/{{member}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/train_member/{{model}}/{{member}}.tsv"
    wildcard_constraints:
        model="|".join(MODELS) or "none",
    retries: 1
    threads: 1
    resources:
        mem_mb=lambda wildcards, attempt: 5000 * attempt,
        runtime=lambda wildcards, attempt: 720 * attempt,
    params:
        identity=lambda wildcards: CONFIG.model_fingerprint(wildcards.model),
        model=lambda wildcards: MODELS[wildcards.model].model_dump(mode="json"),
        seed=lambda wildcards: CONFIG.seed + int(wildcards.member),
        layers=CONFIG.layers,
        checkpoint=lambda wildcards, output: f"{Path(output.weights).parent}/checkpoint.pt",
    script:
        "../scripts/train_member.py"


rule assemble_model:
    """Assemble the networks of a model, and calibrate its bands on its campaigns' validation splits."""
    input:
        stacks=rules.train_member.input.stacks,
        moulds=rules.train_member.input.moulds,
        weights=lambda wildcards: expand(
            rules.train_member.output.weights,
            member=range(MODELS[wildcards.model].ensemble_size),
            allow_missing=True,
        ),
        histories=lambda wildcards: expand(
            rules.train_member.output.history,
            member=range(MODELS[wildcards.model].ensemble_size),
            allow_missing=True,
        ),
    output:
        weights=f"{RESULTS}/surrogate/{{model}}/weights.safetensors",
        model=f"{RESULTS}/surrogate/{{model}}/model.json",
        history=report(
            f"{RESULTS}/surrogate/{{model}}/training.csv",
            category="Surrogate",
            labels={"model": "{model}", "what": "training"},
        ),
    log:
        f"{RESULTS}/logs/assemble_model/{{model}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/assemble_model/{{model}}.tsv"
    wildcard_constraints:
        model="|".join(MODELS) or "none",
    threads: 1
    resources:
        mem_mb=2500,
    params:
        seed=CONFIG.seed,
        fraction=lambda wildcards: MODELS[wildcards.model].training_fraction,
    script:
        "../scripts/assemble_model.py"


# The model trained here that is shipped; the weights of every model, one of which may be trained before.
OWN = {
    name: expand(rules.assemble_model.output[name], model=CONFIG.own_model or [])
    for name in ("weights", "model", "history")
}
WEIGHTS = {
    name: expand(rules.assemble_model.output.weights, model=name) for name in MODELS
}
if CONFIG.trained_folder:
    WEIGHTS[CONFIG.given_model] = [str(CONFIG.trained_folder / "weights.safetensors")]
SURROGATE = WEIGHTS.get(CONFIG.surrogate, [])


rule train:
    """All models, trained."""
    input:
        expand(rules.assemble_model.output, model=MODELS),


rule measure_floor:
    """Measure a campaign's noise floor: the differences between simulations with different seeds."""
    input:
        stack=rules.build_stack.output.stack,
        moulds=rules.design_campaign.output.moulds,
        repeats=lambda wildcards: expand(
            rules.build_stack.output.stack, campaign=REPEATS[wildcards.campaign]
        ),
    output:
        floor=report(
            f"{RESULTS}/evaluation/floors/{{campaign}}.csv",
            category="Surrogate",
            labels={"campaign": "{campaign}", "what": "noise floor"},
        ),
    log:
        f"{RESULTS}/logs/measure_floor/{{campaign}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/measure_floor/{{campaign}}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    script:
        "../scripts/measure_floor.py"


rule evaluate_model:
    """Evaluate a model, or a baseline without a network, on the test runs of a campaign."""
    input:
        stack=rules.build_stack.output.stack,
        moulds=rules.design_campaign.output.moulds,
        weights=lambda wildcards: WEIGHTS.get(wildcards.model, []),
        # A baseline predicts from the campaign's own training split.
        examples=lambda wildcards: expand(
            rules.list_examples.output.examples,
            campaign=wildcards.campaign if wildcards.model in BASELINES else [],
        ),
    output:
        metrics=f"{RESULTS}/evaluation/{{model}}/campaigns/{{campaign}}.csv",
    log:
        f"{RESULTS}/logs/evaluate_model/{{model}}/{{campaign}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/evaluate_model/{{model}}/{{campaign}}.tsv"
    threads: 1
    resources:
        mem_mb=2500,
    script:
        "../scripts/evaluate_model.py"


rule summarise_evaluation:
    """Summarise a model's errors on the test split of each campaign, by region, over the noise floor."""
    input:
        metrics=lambda wildcards: expand(
            rules.evaluate_model.output.metrics,
            campaign=CONFIG.tested if wildcards.model in WEIGHTS else LEARNT,
            allow_missing=True,
        ),
        floors=expand(
            rules.measure_floor.output.floor,
            campaign=[name for name in CONFIG.tested if REPEATS[name]],
        ),
    output:
        metrics=f"{RESULTS}/evaluation/{{model}}/metrics.csv",
        summary=f"{RESULTS}/evaluation/{{model}}/metrics.json",
        regions=report(
            f"{RESULTS}/evaluation/{{model}}/regions.csv",
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
    params:
        campaigns=lambda wildcards: (
            MODELS[wildcards.model].campaigns if wildcards.model in MODELS else LEARNT
        ),
    script:
        "../scripts/summarise_evaluation.py"


# Errors of the surrogate on the test runs, if there are models, whose campaigns have them.
ERRORS = {
    name: expand(
        rules.summarise_evaluation.output[name],
        model=CONFIG.surrogate if MODELS else [],
    )
    for name in ("metrics", "summary", "regions")
}


rule compare_models:
    """Compare the cost and errors of all models in one table."""
    input:
        summaries=expand(
            rules.summarise_evaluation.output.summary,
            model=[*WEIGHTS, *BASELINES],
        ),
        regions=expand(rules.summarise_evaluation.output.regions, model=WEIGHTS),
        weights=list(WEIGHTS.values()),
        histories=expand(rules.assemble_model.output.history, model=MODELS),
    output:
        table=report(f"{RESULTS}/evaluation/models.csv", category="Surrogate"),
        regions=report(
            f"{RESULTS}/evaluation/models_by_region.csv", category="Surrogate"
        ),
        campaigns=report(
            f"{RESULTS}/evaluation/models_by_campaign.csv", category="Surrogate"
        ),
    log:
        f"{RESULTS}/logs/compare_models.log",
    benchmark:
        f"{RESULTS}/benchmarks/compare_models.tsv"
    threads: 2
    resources:
        mem_mb=2500,
    params:
        campaign=CONFIG.main_campaign,
        models=list(WEIGHTS),
    script:
        "../scripts/compare_models.py"


rule predict_samples:
    """Predict, and simulate with further seeds, the samples in figures: those with the median and the largest errors."""
    input:
        kernels=ancient(rules.compile_kernels.output.kernels),
        stack=expand(rules.build_stack.output.stack, campaign=MAIN),
        moulds=expand(rules.design_campaign.output.moulds, campaign=MAIN),
        metrics=ERRORS["metrics"],
        weights=SURROGATE,
    output:
        samples=f"{RESULTS}/evaluation/samples.nc",
    log:
        f"{RESULTS}/logs/predict_samples.log",
    benchmark:
        f"{RESULTS}/benchmarks/predict_samples.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        simulator=SIMULATOR,
        seeds=3,
    script:
        "../scripts/predict_samples.py"


rule ship_model:
    """Write a model trained here for the package: weights in half precision, and a model card."""
    input:
        **OWN,
        summary=expand(
            rules.summarise_evaluation.output.summary, model=CONFIG.own_model or []
        ),
        regions=expand(
            rules.summarise_evaluation.output.regions, model=CONFIG.own_model or []
        ),
    output:
        weights=f"{RESULTS}/shipped/weights.safetensors",
        model=f"{RESULTS}/shipped/model.json",
        card=report(f"{RESULTS}/shipped/card.md", category="Surrogate"),
    log:
        f"{RESULTS}/logs/ship_model.log",
    benchmark:
        f"{RESULTS}/benchmarks/ship_model.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    params:
        name=CONFIG.name,
        model=CONFIG.own_model,
        campaigns=MODELS[CONFIG.own_model].campaigns if MODELS else [],
    script:
        "../scripts/ship_model.py"


rule designer:
    """Write the page on which one draws a mould and sees what the surrogate predicts."""
    input:
        weights=rules.ship_model.output.weights,
        model=rules.ship_model.output.model,
    output:
        page=f"{RESULTS}/designer.html",
    log:
        f"{RESULTS}/logs/designer.log",
    benchmark:
        f"{RESULTS}/benchmarks/designer.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    script:
        "../scripts/designer.py"


rule evaluate:
    """The errors of all models."""
    input:
        (
            [
                rules.compare_models.output,
                rules.ship_model.output.card,
                *ERRORS.values(),
            ]
            if MODELS
            else []
        ),
