"""The data set: field stack, augmented examples, scaling, card, checks."""


rule build_stack:
    """Rasterise every simulation into the unaugmented field stack."""
    input:
        design=rules.sample_design.output.design,
        moulds=rules.sample_design.output.moulds,
        shards=expand(rules.simulate_shard.output.shard, shard=CONFIG.shards),
    output:
        stack=f"{RESULTS}/dataset/fields.nc",
    log:
        f"{RESULTS}/logs/build_stack.log",
    benchmark:
        f"{RESULTS}/benchmarks/build_stack.tsv"
    retries: 1
    threads: 1
    resources:
        mem_mb=1500,
    params:
        pixels=CONFIG.fields.pixels,
        simulation_configuration=CONFIG.fingerprint("simulation"),
        configuration=CONFIG.fingerprint("dataset"),
    script:
        "../scripts/build_stack.py"


rule augment_dataset:
    """List every distinct image of every sample under D4, and scale by the training split."""
    input:
        stack=rules.build_stack.output.stack,
    output:
        examples=f"{RESULTS}/dataset/examples.csv",
        normalisation=f"{RESULTS}/dataset/normalisation.json",
        augmented=(
            [f"{RESULTS}/dataset/augmented.nc"] if CONFIG.dataset.materialise else []
        ),
    log:
        f"{RESULTS}/logs/augment_dataset.log",
    benchmark:
        f"{RESULTS}/benchmarks/augment_dataset.tsv"
    retries: 1
    threads: 1
    resources:
        mem_mb=1000,
    params:
        configuration=CONFIG.fingerprint("dataset"),
    script:
        "../scripts/augment_dataset.py"


rule check_dataset:
    """Hold the whole data set against its rules; any fault stops the workflow here."""
    input:
        design=rules.sample_design.output.design,
        moulds=rules.sample_design.output.moulds,
        shards=rules.build_stack.input.shards,
        stack=rules.build_stack.output.stack,
        examples=rules.augment_dataset.output.examples,
        normalisation=rules.augment_dataset.output.normalisation,
    output:
        checked=f"{RESULTS}/dataset/checked.txt",
    log:
        f"{RESULTS}/logs/check_dataset.log",
    benchmark:
        f"{RESULTS}/benchmarks/check_dataset.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    params:
        folder=lambda wildcards, input: str(Path(input.stack).parents[1]),
        part=CONFIG.dataset.checked,
    script:
        "../scripts/check_dataset.py"


rule write_card:
    """Describe the data set: equations, counts, ranges, choices, cost."""
    input:
        shards=rules.build_stack.input.shards,
        design=rules.sample_design.output.design,
        moulds=rules.sample_design.output.moulds,
        stack=rules.build_stack.output.stack,
        examples=rules.augment_dataset.output.examples,
    output:
        card=report(
            f"{RESULTS}/dataset/card.md",
            caption="../report/card.rst",
            category="Data set",
        ),
    log:
        f"{RESULTS}/logs/write_card.log",
    benchmark:
        f"{RESULTS}/benchmarks/write_card.tsv"
    threads: 1
    resources:
        mem_mb=1000,
    params:
        name=CONFIG.name,
    script:
        "../scripts/write_card.py"


rule dataset:
    """The checked data set."""
    input:
        rules.record_configuration.output,
        # Named one by one: Snakemake does not make a lost file again that no target asks for.
        rules.build_stack.input.shards,
        rules.build_stack.output,
        rules.augment_dataset.output,
        rules.check_dataset.output,
        rules.write_card.output,
