"""CONDOR simulations, in shards."""


rule compile_kernels:
    """Compile the kernels once, before many jobs would do it at the same time."""
    output:
        kernels=f"{RESULTS}/simulations/kernels.json",
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


rule simulate_shard:
    """Simulate some runs of the design into one file."""
    input:
        design=rules.sample_design.output.design,
        moulds=rules.sample_design.output.moulds,
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        shard=f"{RESULTS}/simulations/{{shard}}.nc",
    log:
        f"{RESULTS}/logs/simulate_shard/{{shard}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/simulate_shard/{{shard}}.tsv"
    retries: 2
    threads: 1
    resources:
        mem_mb=lambda wildcards, attempt: (400 + 4 * CONFIG.simulation.shard_size)
        * attempt,
        runtime=lambda wildcards, attempt: (10 + 2 * CONFIG.simulation.shard_size)
        * attempt,
    params:
        configuration=CONFIG.fingerprint("simulation"),
        layers=CONFIG.model.layers,
        shells=CONFIG.model.shells,
        tension=CONFIG.model.tension,
        accuracy=CONFIG.simulation.accuracy,
    script:
        "../scripts/simulate_shard.py"
