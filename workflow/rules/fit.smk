"""Fits of measured tissues."""


rule fit_tissue:
    """Fit the three parameters to a tissue by the surrogate; simulate it again at the fit."""
    input:
        mould=lambda wildcards: TISSUES[wildcards.tissue].mould,
        weights=SURROGATE["weights"],
        model=SURROGATE["model"],
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        fit=report(
            f"{RESULTS}/fits/{{tissue}}.json",
            caption="../report/fit.rst",
            category="Fits",
            labels={"tissue": "{tissue}", "what": "fit"},
        ),
        tissue=f"{RESULTS}/fits/{{tissue}}.nc",
    log:
        f"{RESULTS}/logs/fit_tissue/{{tissue}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/fit_tissue/{{tissue}}.tsv"
    threads: 2
    resources:
        mem_mb=2000,
    params:
        tissue=lambda wildcards: TISSUES[wildcards.tissue].model_dump(mode="json"),
        mould_scale=CONFIG.fit.mould_scale,
        starts=CONFIG.fit.starts,
        seed=CONFIG.seed,
        model=CONFIG.model.model_dump(mode="json"),
        accuracy=CONFIG.simulation.accuracy,
        configuration=CONFIG.model_fingerprint(CONFIG.surrogate.model),
    script:
        "../scripts/fit_tissue.py"


rule tabulate_fits:
    """All fits beside the paper's, as one table."""
    input:
        fits=expand(rules.fit_tissue.output.fit, tissue=CONFIG.fit.tissues),
    output:
        table=report(
            f"{RESULTS}/fits/fits.csv",
            caption="../report/fits.rst",
            category="Fits",
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


rule plot_fit:
    """Draw a fitted tissue, predicted and simulated, with its measures beside the target's."""
    input:
        fit=rules.fit_tissue.output.fit,
        tissue=rules.fit_tissue.output.tissue,
        mould=rules.fit_tissue.input.mould,
        weights=SURROGATE["weights"],
    output:
        png=report(
            f"{RESULTS}/figures/fit_{{tissue}}.png",
            caption="../report/plot_fit.rst",
            category="Fits",
            labels={"tissue": "{tissue}", "what": "figure"},
        ),
        svg=f"{RESULTS}/figures/fit_{{tissue}}.svg",
        data=f"{RESULTS}/figures/fit_{{tissue}}.nc",
    log:
        f"{RESULTS}/logs/plot_fit/{{tissue}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_fit/{{tissue}}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    script:
        "../scripts/plot_fit.py"


rule fit:
    """The fitted tissues."""
    input:
        rules.tabulate_fits.output,
        expand(rules.plot_fit.output.png, tissue=CONFIG.fit.tissues),
