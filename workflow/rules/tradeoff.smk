"""Speed against accuracy."""


rule measure_tradeoff:
    """Cost and errors of each accuracy level, and of the surrogate, on held-out moulds."""
    input:
        design=rules.sample_design.output.design,
        moulds=rules.sample_design.output.moulds,
        weights=rules.train_surrogate.output.weights,
        model=rules.train_surrogate.output.model,
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        table=report(
            f"{RESULTS}/tradeoff/tradeoff.csv",
            caption="../report/tradeoff.rst",
            category="Trade-off",
        ),
    log:
        f"{RESULTS}/logs/measure_tradeoff.log",
    benchmark:
        f"{RESULTS}/benchmarks/measure_tradeoff.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        model=CONFIG.model.model_dump(mode="json"),
        tradeoff=CONFIG.tradeoff.model_dump(mode="json"),
        model_version=MODEL_VERSION,
    script:
        "../scripts/measure_tradeoff.py"


rule tradeoff:
    """The trade of speed against accuracy, measured."""
    input:
        rules.measure_tradeoff.output,
        f"{RESULTS}/figures/tradeoff.png",
