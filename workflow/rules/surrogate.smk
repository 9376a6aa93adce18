"""Training of the surrogate."""


rule train_surrogate:
    """Train the surrogate; goes on from its checkpoint after an interruption."""
    input:
        stack=rules.build_stack.output.stack,
        examples=rules.augment_dataset.output.examples,
        normalisation=rules.augment_dataset.output.normalisation,
        checked=rules.check_dataset.output.checked,
    output:
        weights=f"{MODEL}/weights.safetensors",
        model=f"{MODEL}/model.json",
        history=report(
            f"{MODEL}/training.csv",
            caption="../report/training_table.rst",
            category="Surrogate",
        ),
    log:
        f"{RESULTS}/logs/train_surrogate.log",
    benchmark:
        f"{RESULTS}/benchmarks/train_surrogate.tsv"
    retries: 1
    threads: CONFIG.surrogate.threads
    resources:
        mem_mb=lambda wildcards, attempt: 4000 * attempt,
        runtime=lambda wildcards, attempt: 720 * attempt,
    params:
        identity=CONFIG.fingerprint("surrogate"),
        surrogate=CONFIG.surrogate.model_dump(mode="json"),
        seed=CONFIG.seed,
        layers=CONFIG.model.layers,
        checkpoint=lambda wildcards, output: f"{Path(output.weights).parent}/checkpoint.pt",
    script:
        "../scripts/train_surrogate.py"


rule train:
    """The trained surrogate."""
    input:
        rules.train_surrogate.output,
