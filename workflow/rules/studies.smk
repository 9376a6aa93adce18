"""Studies: contraction over the parameters, and speed against accuracy."""

# The case whose tissue is drawn folded, where anneals are compared.
FOLDED = [CONFIG.tradeoff.annealed[0]] if CONFIG.tradeoff.annealed else []


rule predict_campaign:
    """Predict area and width with bands at every point of a campaign, and the fields shown in figures."""
    input:
        design=rules.design_campaign.output.design,
        moulds=rules.design_campaign.output.moulds,
        weights=SURROGATE,
    output:
        table=f"{STUDY}/predicted.csv",
        fields=f"{STUDY}/predicted.nc",
    log:
        f"{RESULTS}/logs/predict_campaign/{{campaign}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/predict_campaign/{{campaign}}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    script:
        "../scripts/predict_campaign.py"


rule compare_contraction:
    """Compare contraction, simulated and predicted: the largest difference and its position."""
    input:
        simulated=rules.tabulate_campaign.output.table,
        predicted=rules.predict_campaign.output.table if CONFIG.has_surrogate else [],
    output:
        table=report(
            f"{STUDY}/contraction.csv",
            category="Studies",
            labels={"campaign": "{campaign}", "what": "contraction"},
        ),
        differences=f"{STUDY}/differences.json",
    log:
        f"{RESULTS}/logs/compare_contraction/{{campaign}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/compare_contraction/{{campaign}}.tsv"
    threads: 1
    resources:
        mem_mb=800,
    script:
        "../scripts/compare_contraction.py"


rule measure_tradeoff:
    """Measure cost and errors of each method on one mould and set of parameters."""
    input:
        mould=lambda wildcards: find_mould(CASES[wildcards.case].mould),
        surrogate=lambda wildcards: (
            SURROGATE if CONFIG.trial(wildcards.case)["surrogate"] else []
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
        trial=lambda wildcards: CONFIG.trial(wildcards.case),
        methods=CONFIG.tradeoff.methods,
        model_version=MODEL_VERSION,
    script:
        "../scripts/measure_tradeoff.py"


rule tabulate_tradeoff:
    """Collect all cases in one table, and summarise them by method."""
    input:
        cases=expand(rules.measure_tradeoff.output.table, case=CASES),
    output:
        table=f"{RESULTS}/tradeoff/tradeoff.csv",
        summary=report(f"{RESULTS}/tradeoff/summary.csv", category="Trade-off"),
    log:
        f"{RESULTS}/logs/tabulate_tradeoff.log",
    benchmark:
        f"{RESULTS}/benchmarks/tabulate_tradeoff.tsv"
    threads: 1
    resources:
        mem_mb=500,
    script:
        "../scripts/tabulate_tradeoff.py"


rule search_moulds:
    """Search for moulds whose tissues do what a specification asks for, and simulate the best."""
    input:
        spec=lambda wildcards: CONFIG.searches[wildcards.search],
        weights=SURROGATE,
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        table=report(
            f"{RESULTS}/searches/{{search}}/designs.csv",
            category="Studies",
            labels={"campaign": "{search}", "what": "designs"},
        ),
        front=f"{RESULTS}/searches/{{search}}/front.csv",
        moulds=f"{RESULTS}/searches/{{search}}/designs.geojson",
        figure=report(
            f"{RESULTS}/figures/front_{{search}}.png",
            category="Studies",
            labels={"campaign": "{search}", "what": "front"},
        ),
    log:
        f"{RESULTS}/logs/search_moulds/{{search}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/search_moulds/{{search}}.tsv"
    threads: 1
    resources:
        mem_mb=2500,
    params:
        model_version=MODEL_VERSION,
    script:
        "../scripts/search_moulds.py"
