"""How good the surrogate is on held-out simulations."""


rule evaluate_surrogate:
    """Errors of fields and bulk statistics on the test split, beside baselines."""
    input:
        stack=rules.build_stack.output.stack,
        moulds=rules.sample_design.output.moulds,
        examples=rules.augment_dataset.output.examples,
        weights=rules.train_surrogate.output.weights,
        model=rules.train_surrogate.output.model,
    output:
        metrics=report(
            f"{RESULTS}/evaluation/{CONFIG.surrogate.model}/metrics.csv",
            caption="../report/metrics.rst",
            category="Surrogate",
        ),
        summary=report(
            f"{RESULTS}/evaluation/{CONFIG.surrogate.model}/metrics.json",
            caption="../report/metrics.rst",
            category="Surrogate",
        ),
    log:
        f"{RESULTS}/logs/evaluate_surrogate.log",
    benchmark:
        f"{RESULTS}/benchmarks/evaluate_surrogate.tsv"
    threads: CONFIG.surrogate.threads
    resources:
        mem_mb=2000,
    script:
        "../scripts/evaluate_surrogate.py"


rule evaluate:
    """The surrogate's errors."""
    input:
        rules.evaluate_surrogate.output,
