"""Training of the surrogate, and of what it is compared with."""


rule train_member:
    """Train one network of a model; goes on from its checkpoint after an interruption."""
    input:
        stack=rules.build_stack.output.stack,
        extra=lambda wildcards: (
            f"{RESULTS}/further/{MODELS[wildcards.model].extra}/fields.nc"
            if MODELS[wildcards.model].extra
            else []
        ),
        begun=lambda wildcards: (
            f"{RESULTS}/surrogate/{MODELS[wildcards.model].initial_weights}/members/{wildcards.member}/weights.safetensors"
            if MODELS[wildcards.model].initial_weights
            else []
        ),
        examples=rules.augment_dataset.output.examples,
        normalisation=rules.augment_dataset.output.normalisation,
        checked=rules.check_dataset.output.checked,
    output:
        weights=f"{RESULTS}/surrogate/{{model}}/members/{{member}}/weights.safetensors",
        model=f"{RESULTS}/surrogate/{{model}}/members/{{member}}/model.json",
        history=f"{RESULTS}/surrogate/{{model}}/members/{{member}}/training.csv",
    log:
        f"{RESULTS}/logs/train_member/{{model}}/{{member}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/train_member/{{model}}/{{member}}.tsv"
    retries: 1
    threads: lambda wildcards: MODELS[wildcards.model].threads
    resources:
        mem_mb=lambda wildcards, attempt: 5000 * attempt,
        runtime=lambda wildcards, attempt: 720 * attempt,
    params:
        identity=lambda wildcards: CONFIG.model_fingerprint(wildcards.model),
        surrogate=lambda wildcards: MODELS[wildcards.model].model_dump(mode="json"),
        seed=lambda wildcards: CONFIG.seed + int(wildcards.member),
        layers=CONFIG.model.layers,
        checkpoint=lambda wildcards, output: f"{Path(output.weights).parent}/checkpoint.pt",
    script:
        "../scripts/train_member.py"


rule assemble_model:
    """Put the members of a model together, and calibrate their spread on the validation split."""
    input:
        stack=rules.build_stack.output.stack,
        moulds=rules.sample_design.output.moulds,
        weights=lambda wildcards: expand(
            rules.train_member.output.weights,
            member=range(MODELS[wildcards.model].ensemble_size),
            allow_missing=True,
        ),
        models=lambda wildcards: expand(
            rules.train_member.output.model,
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
            caption="../report/training_table.rst",
            category="Surrogate",
            labels={"model": "{model}", "what": "training"},
        ),
    log:
        f"{RESULTS}/logs/assemble_model/{{model}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/assemble_model/{{model}}.tsv"
    threads: 1
    resources:
        mem_mb=2500,
    params:
        seed=CONFIG.seed,
    script:
        "../scripts/assemble_model.py"


# The model that further simulations are chosen by, and the one that tissues are fitted and drawn by.
FIRST, SURROGATE = (
    {
        name: expand(rules.assemble_model.output[name], model=model)[0]
        for name in ("weights", "model", "history")
    }
    for model in (CONFIG.surrogate.model, CONFIG.chosen_model)
)


rule train:
    """Every model, trained."""
    input:
        expand(rules.assemble_model.output, model=MODELS),
