"""Fits of measured tissues."""

FITTED = list(TISSUES)
JOINT = CONFIG.fit.joint if CONFIG.has_surrogate else ()


rule fit_tissue:
    """Fit a tissue by the surrogate, correct the fit by a few simulations, and verify both."""
    input:
        mould=lambda wildcards: find_mould(TISSUES[wildcards.tissue].mould),
        weights=SURROGATE,
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        fit=f"{RESULTS}/fits/{{tissue}}.json",
        tissue=f"{RESULTS}/fits/{{tissue}}.nc",
        prediction=f"{RESULTS}/fits/{{tissue}}_prediction.nc",
    log:
        f"{RESULTS}/logs/fit_tissue/{{tissue}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/fit_tissue/{{tissue}}.tsv"
    threads: 2
    resources:
        mem_mb=2000,
    params:
        tissue=lambda wildcards: TISSUES[wildcards.tissue].model_dump(mode="json"),
        mould_scale=CONFIG.mould_scale,
        simulator=SIMULATOR,
        configuration=CONFIG.surrogate_fingerprint,
    script:
        "../scripts/fit_tissue.py"


rule fit_by_simulator:
    """Fit a tissue by the simulator, from the corrected fit, within a budget of simulations."""
    input:
        fit=rules.fit_tissue.output.fit,
        mould=rules.fit_tissue.input.mould,
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        fit=f"{RESULTS}/fits/{{tissue}}_simulator.json",
        tissue=f"{RESULTS}/fits/{{tissue}}_simulator.nc",
    log:
        f"{RESULTS}/logs/fit_by_simulator/{{tissue}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/fit_by_simulator/{{tissue}}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    params:
        simulations=CONFIG.fit.simulations,
        mould_scale=CONFIG.mould_scale,
        simulator=SIMULATOR,
        configuration=rules.fit_tissue.params.configuration,
    script:
        "../scripts/fit_by_simulator.py"


rule infer_parameters:
    """Infer the posterior of a tissue's parameters, and rank measurements that would narrow it."""
    input:
        fit=rules.fit_tissue.output.fit,
        mould=rules.fit_tissue.input.mould,
        weights=SURROGATE,
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        posterior=f"{RESULTS}/fits/{{tissue}}_posterior.json",
        points=f"{RESULTS}/fits/{{tissue}}_points.csv",
        draws=f"{RESULTS}/fits/{{tissue}}_draws.csv",
        experimental_design=report(
            f"{RESULTS}/fits/{{tissue}}_experimental_design.csv",
            category="Fits",
            labels={"tissue": "{tissue}", "what": "experimental design"},
        ),
    log:
        f"{RESULTS}/logs/infer_parameters/{{tissue}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/infer_parameters/{{tissue}}.tsv"
    threads: 1
    resources:
        mem_mb=2500,
    params:
        mould_scale=CONFIG.mould_scale,
        simulator=SIMULATOR,
    script:
        "../scripts/infer_parameters.py"


rule fit_joint:
    """Fit several tissues with common parameters, by the surrogate and by the simulator."""
    input:
        fits=expand(rules.fit_tissue.output.fit, tissue=JOINT),
        moulds=[find_mould(TISSUES[tissue].mould) for tissue in JOINT],
        weights=SURROGATE,
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        fit=f"{RESULTS}/fits/joint.json",
        table=report(
            f"{RESULTS}/fits/joint.csv",
            category="Fits",
            labels={"tissue": "all", "what": "joint fit"},
        ),
    log:
        f"{RESULTS}/logs/fit_joint.log",
    benchmark:
        f"{RESULTS}/benchmarks/fit_joint.tsv"
    threads: 2
    resources:
        mem_mb=2000,
    params:
        mould_scale=CONFIG.mould_scale,
        simulations=CONFIG.fit.simulations,
        simulator=SIMULATOR,
    script:
        "../scripts/fit_joint.py"


rule fit_outline:
    """Fit a simulated tissue with known parameters, by its ratios and by its whole outline."""
    input:
        tissue=rules.fit_tissue.output.tissue,
        mould=rules.fit_tissue.input.mould,
        weights=SURROGATE,
    output:
        fit=f"{RESULTS}/fits/{{tissue}}_outline.json",
    log:
        f"{RESULTS}/logs/fit_outline/{{tissue}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/fit_outline/{{tissue}}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        mould_scale=CONFIG.mould_scale,
        seed=CONFIG.seed,
    script:
        "../scripts/fit_outline.py"


# Fits by the simulator, if it has a budget.
BY_SIMULATOR = FITTED if CONFIG.fit.simulations else []


rule tabulate_fits:
    """Collect all fits, with the paper's, in one table."""
    input:
        fits=expand(rules.fit_tissue.output.fit, tissue=FITTED),
        simulators=expand(rules.fit_by_simulator.output.fit, tissue=BY_SIMULATOR),
    output:
        table=report(
            f"{RESULTS}/fits/fits.csv",
            category="Fits",
            labels={"tissue": "all", "what": "fits"},
        ),
    log:
        f"{RESULTS}/logs/tabulate_fits.log",
    benchmark:
        f"{RESULTS}/benchmarks/tabulate_fits.tsv"
    threads: 1
    resources:
        mem_mb=500,
    script:
        "../scripts/tabulate_fits.py"
