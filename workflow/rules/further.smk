"""Simulations beside the design: the noise floor, what is unlike all drawn, and more to learn from."""


rule design_further:
    """Choose the moulds, parameters and seeds of a further set."""
    input:
        design=rules.sample_design.output.design,
        moulds=rules.sample_design.output.moulds,
    output:
        design=f"{RESULTS}/further/{{set}}/design.csv",
        moulds=f"{RESULTS}/further/{{set}}/moulds.geojson",
    log:
        f"{RESULTS}/logs/design_further/{{set}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/design_further/{{set}}.tsv"
    threads: 1
    resources:
        mem_mb=800,
    params:
        size=lambda wildcards: SETS[wildcards.set],
        configuration=lambda wildcards: CONFIG.further_fingerprint(wildcards.set),
        dump=CONFIG.dump_drawn("further"),
    script:
        "../scripts/design_further.py"


rule enrich:
    """Choose further training simulations where the surrogate's networks disagree most."""
    input:
        **FIRST,
    output:
        design=f"{RESULTS}/further/enriched/design.csv",
        moulds=f"{RESULTS}/further/enriched/moulds.geojson",
        candidates=f"{RESULTS}/further/enriched/candidates.csv",
    log:
        f"{RESULTS}/logs/enrich.log",
    benchmark:
        f"{RESULTS}/benchmarks/enrich.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        size=SETS.get("enriched"),
        dump=CONFIG.dump_drawn("further"),
    script:
        "../scripts/enrich.py"


ruleorder: enrich > design_further


use rule simulate_shard as simulate_further with:
    input:
        design=rules.design_further.output.design,
        moulds=rules.design_further.output.moulds,
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        shard=f"{RESULTS}/further/{{set}}/{{shard}}.nc",
    log:
        f"{RESULTS}/logs/simulate_further/{{set}}/{{shard}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/simulate_further/{{set}}/{{shard}}.tsv"
    params:
        configuration=lambda wildcards: CONFIG.further_fingerprint(wildcards.set),
        layers=CONFIG.model.layers,
        shells=CONFIG.model.shells,
        tension=CONFIG.model.tension,
        accuracy=CONFIG.simulation.accuracy,


use rule build_stack as stack_further with:
    input:
        design=rules.design_further.output.design,
        moulds=rules.design_further.output.moulds,
        shards=lambda wildcards: expand(
            rules.simulate_further.output.shard,
            shard=CONFIG.shards_of(SETS[wildcards.set]),
            allow_missing=True,
        ),
    output:
        stack=f"{RESULTS}/further/{{set}}/fields.nc",
    log:
        f"{RESULTS}/logs/stack_further/{{set}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/stack_further/{{set}}.tsv"
    params:
        pixels=CONFIG.fields.pixels,
        simulation_configuration=lambda wildcards: CONFIG.further_fingerprint(
            wildcards.set
        ),
        configuration=lambda wildcards: CONFIG.further_fingerprint(wildcards.set),


rule measure_floor:
    """How far simulations of other seeds differ: what no prediction can beat."""
    input:
        stack=rules.build_stack.output.stack,
        further=(
            expand(rules.stack_further.output.stack, set="floor")
            if "floor" in SETS
            else []
        ),
        moulds=rules.sample_design.output.moulds,
    output:
        floor=report(
            f"{RESULTS}/evaluation/floor.csv",
            caption="../report/floor.rst",
            category="Surrogate",
        ),
    log:
        f"{RESULTS}/logs/measure_floor.log",
    benchmark:
        f"{RESULTS}/benchmarks/measure_floor.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    params:
        layers=CONFIG.model.layers,
    script:
        "../scripts/measure_floor.py"
