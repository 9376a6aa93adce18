"""Speed against accuracy."""


rule measure_tradeoff:
    """Cost and errors of each method on one mould and one set of parameters."""
    input:
        mould=lambda wildcards: find_mould(CASES[wildcards.case].mould),
        surrogate=lambda wildcards: (
            [SURROGATE["weights"], SURROGATE["model"]]
            if CONFIG.comparison(CASES[wildcards.case])["surrogate"]
            else []
        ),
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        table=f"{RESULTS}/tradeoff/cases/{{case}}.csv",
    log:
        f"{RESULTS}/logs/measure_tradeoff/{{case}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/measure_tradeoff/{{case}}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        comparison=lambda wildcards: CONFIG.comparison(CASES[wildcards.case]),
        model_version=MODEL_VERSION,
    script:
        "../scripts/measure_tradeoff.py"


rule tabulate_tradeoff:
    """All cases as one table, and what they come to by method."""
    input:
        cases=expand(rules.measure_tradeoff.output.table, case=CASES),
    output:
        table=f"{RESULTS}/tradeoff/tradeoff.csv",
        summary=report(
            f"{RESULTS}/tradeoff/summary.csv",
            caption="../report/tradeoff.rst",
            category="Trade-off",
        ),
    log:
        f"{RESULTS}/logs/tabulate_tradeoff.log",
    benchmark:
        f"{RESULTS}/benchmarks/tabulate_tradeoff.tsv"
    threads: 1
    resources:
        mem_mb=500,
    params:
        tradeoff=CONFIG.tradeoff.model_dump(mode="json"),
    script:
        "../scripts/tabulate_tradeoff.py"


rule plot_folding:
    """One tissue as it contracts, and folded by an anneal."""
    input:
        mould=find_mould(CASES[CONFIG.tradeoff.folding_case].mould),
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        png=report(
            f"{RESULTS}/figures/folding.png",
            caption="../report/plot_folding.rst",
            category="Trade-off",
        ),
        svg=f"{RESULTS}/figures/folding.svg",
        data=f"{RESULTS}/figures/folding.csv",
    log:
        f"{RESULTS}/logs/plot_folding.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_folding.tsv"
    threads: 1
    resources:
        mem_mb=1000,
    params:
        comparison=CONFIG.comparison(CASES[CONFIG.tradeoff.folding_case]),
        method=CONFIG.tradeoff.folding_method,
        model_version=MODEL_VERSION,
    script:
        "../scripts/plot_folding.py"


rule tradeoff:
    """The trade of speed against accuracy, measured."""
    input:
        rules.tabulate_tradeoff.output,
        rules.plot_folding.output.png,
        f"{RESULTS}/figures/tradeoff.png",
