"""Campaigns: one chain of rules for everything that is simulated."""


localrules:
    record_configuration,


rule record_configuration:
    """Write the validated configuration, with defaults, for the report."""
    output:
        configuration=report(f"{RESULTS}/configuration.yaml", category="Configuration"),
    log:
        f"{RESULTS}/logs/record_configuration.log",
    benchmark:
        f"{RESULTS}/benchmarks/record_configuration.tsv"
    threads: 1
    resources:
        mem_mb=200,
    params:
        configuration=CONFIG.model_dump(mode="json"),
    script:
        "../scripts/record_configuration.py"


rule compile_kernels:
    """Compile the kernels once, before jobs would compile them simultaneously."""
    output:
        kernels=f"{RESULTS}/kernels.json",
    log:
        f"{RESULTS}/logs/compile_kernels.log",
    benchmark:
        f"{RESULTS}/benchmarks/compile_kernels.tsv"
    retries: 1
    threads: 1
    resources:
        mem_mb=1000,
    params:
        sources=source_hash(),
    script:
        "../scripts/compile_kernels.py"


rule design_campaign:
    """Draw or read the moulds of a campaign; choose parameters, seed and split of every run."""
    input:
        moulds=lambda wildcards: list(CAMPAIGNS[wildcards.campaign].files().values()),
        repeated=lambda wildcards: (
            expand(
                [f"{CAMPAIGN}/design.csv", f"{CAMPAIGN}/moulds.geojson"],
                campaign=CAMPAIGNS[wildcards.campaign].repeat_of or [],
            )
        ),
        model=lambda wildcards: expand(
            f"{RESULTS}/surrogate/{{model}}/weights.safetensors",
            model=CAMPAIGNS[wildcards.campaign].selected_by or [],
        ),
    output:
        design=report(
            f"{CAMPAIGN}/design.csv",
            category="Campaigns",
            labels={"campaign": "{campaign}", "what": "design"},
        ),
        moulds=f"{CAMPAIGN}/moulds.geojson",
    log:
        f"{RESULTS}/logs/design_campaign/{{campaign}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/design_campaign/{{campaign}}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        design=lambda wildcards: CONFIG.design(wildcards.campaign).model_dump(
            mode="json"
        ),
        configuration=lambda wildcards: CONFIG.fingerprint("design", wildcards.campaign),
    script:
        "../scripts/design_campaign.py"


rule simulate_shard:
    """Simulate a shard of a campaign: some runs, one file."""
    input:
        design=rules.design_campaign.output.design,
        moulds=rules.design_campaign.output.moulds,
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        shard=f"{CAMPAIGN}/shards/{{shard}}.nc",
    log:
        f"{RESULTS}/logs/simulate_shard/{{campaign}}/{{shard}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/simulate_shard/{{campaign}}/{{shard}}.tsv"
    retries: 2
    threads: 1
    resources:
        mem_mb=lambda wildcards, attempt: (400 + 4 * CONFIG.shard_size) * attempt,
        runtime=lambda wildcards, attempt: (10 + 2 * CONFIG.shard_size) * attempt,
    params:
        simulator=CONFIG.simulator,
        configuration=lambda wildcards: CONFIG.fingerprint(
            "simulation", wildcards.campaign
        ),
    script:
        "../scripts/simulate_shard.py"


rule build_stack:
    """Rasterise every simulation of a campaign into images of its fields, and measure its shape."""
    input:
        design=rules.design_campaign.output.design,
        moulds=rules.design_campaign.output.moulds,
        shards=lambda wildcards: expand(
            rules.simulate_shard.output.shard,
            shard=CONFIG.shards(wildcards.campaign),
            allow_missing=True,
        ),
    output:
        stack=f"{CAMPAIGN}/fields.nc",
    log:
        f"{RESULTS}/logs/build_stack/{{campaign}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/build_stack/{{campaign}}.tsv"
    retries: 1
    threads: 1
    resources:
        mem_mb=1500,
    params:
        pixels=CONFIG.pixels,
        simulation_configuration=lambda wildcards: CONFIG.fingerprint(
            "simulation", wildcards.campaign
        ),
        configuration=lambda wildcards: CONFIG.fingerprint("fields", wildcards.campaign),
    script:
        "../scripts/build_stack.py"


rule list_examples:
    """List the distinct images under D4 of a campaign's training and validation samples."""
    input:
        stack=rules.build_stack.output.stack,
    output:
        examples=f"{CAMPAIGN}/examples.csv",
    log:
        f"{RESULTS}/logs/list_examples/{{campaign}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/list_examples/{{campaign}}.tsv"
    retries: 1
    threads: 1
    resources:
        mem_mb=1000,
    script:
        "../scripts/list_examples.py"


rule check_campaign:
    """Check the files of a campaign against the rules of docs/data.md; any fault stops the workflow."""
    input:
        design=rules.design_campaign.output.design,
        moulds=rules.design_campaign.output.moulds,
        shards=rules.build_stack.input.shards,
        stack=rules.build_stack.output.stack,
        examples=rules.list_examples.output.examples,
    output:
        checked=f"{CAMPAIGN}/checked.txt",
    log:
        f"{RESULTS}/logs/check_campaign/{{campaign}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/check_campaign/{{campaign}}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    params:
        fraction=CONFIG.check_fraction,
    script:
        "../scripts/check_campaign.py"


rule write_card:
    """Describe a campaign: equations, counts, ranges, choices, cost."""
    input:
        design=rules.design_campaign.output.design,
        moulds=rules.design_campaign.output.moulds,
        shards=rules.build_stack.input.shards,
        stack=rules.build_stack.output.stack,
        examples=rules.list_examples.output.examples,
    output:
        card=report(
            f"{CAMPAIGN}/card.md",
            category="Campaigns",
            labels={"campaign": "{campaign}", "what": "card"},
        ),
    log:
        f"{RESULTS}/logs/write_card/{{campaign}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/write_card/{{campaign}}.tsv"
    threads: 1
    resources:
        mem_mb=1000,
    params:
        name=lambda wildcards: f"{wildcards.campaign} of {CONFIG.name}",
    script:
        "../scripts/write_card.py"


rule tabulate_campaign:
    """Tabulate the measures of every simulation of a campaign."""
    input:
        stack=rules.build_stack.output.stack,
    output:
        table=report(
            f"{STUDY}/simulated.csv",
            category="Studies",
            labels={"campaign": "{campaign}", "what": "simulations"},
        ),
    log:
        f"{RESULTS}/logs/tabulate_campaign/{{campaign}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/tabulate_campaign/{{campaign}}.tsv"
    threads: 1
    resources:
        mem_mb=500,
    script:
        "../scripts/tabulate_campaign.py"


rule check_splits:
    """Check that no mould, rotated or reflected, is in two splits of any campaigns."""
    input:
        stacks=expand(rules.build_stack.output.stack, campaign=CAMPAIGNS),
    output:
        checked=f"{RESULTS}/campaigns/splits_checked.txt",
    log:
        f"{RESULTS}/logs/check_splits.log",
    benchmark:
        f"{RESULTS}/benchmarks/check_splits.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    script:
        "../scripts/check_splits.py"


for campaign in CAMPAIGNS:

    rule:
        """One campaign, checked, with its table of measures; NAME is that of the campaign."""
        name:
            f"campaign_{campaign}"
        input:
            # Named one by one: Snakemake does not remake a lost file that no target asks for.
            expand(
                [
                    *rules.design_campaign.output,
                    rules.build_stack.output.stack,
                    rules.list_examples.output.examples,
                    rules.check_campaign.output.checked,
                    rules.write_card.output.card,
                    rules.tabulate_campaign.output.table,
                ],
                campaign=campaign,
            ),
            expand(
                rules.simulate_shard.output.shard,
                campaign=campaign,
                shard=CONFIG.shards(campaign),
            ),


rule campaigns:
    """All campaigns, checked."""
    input:
        [getattr(rules, f"campaign_{campaign}").input for campaign in CAMPAIGNS],
        rules.record_configuration.output,
        rules.check_splits.output,
