"""Fits of measured tissues."""

# How fits simulate; every simulation that they make hangs on this.
SIMULATOR = {
    "model": CONFIG.model.model_dump(mode="json"),
    "accuracy": CONFIG.simulation.accuracy,
    "pixels": CONFIG.fields.pixels,
    "seed": CONFIG.seed,
}


rule fit_tissue:
    """Fit the three parameters to a tissue by the surrogate, correct them by a few simulations, simulate again."""
    input:
        mould=lambda wildcards: find_mould(TISSUES[wildcards.tissue].mould),
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
        corrections=CONFIG.fit.corrections,
        repeats=CONFIG.fit.repeats,
        simulator=SIMULATOR,
        configuration=CONFIG.model_fingerprint(CONFIG.chosen_model),
    script:
        "../scripts/fit_tissue.py"


rule fit_by_simulator:
    """Fit a tissue by the simulator, from the corrected fit on, within a budget of simulations."""
    input:
        fit=rules.fit_tissue.output.fit,
        mould=rules.fit_tissue.input.mould,
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        fit=report(
            f"{RESULTS}/fits/{{tissue}}_simulator.json",
            caption="../report/fit_by_simulator.rst",
            category="Fits",
            labels={"tissue": "{tissue}", "what": "fit by the simulator"},
        ),
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
        repeats=CONFIG.fit.repeats,
        simulator=SIMULATOR,
        configuration=CONFIG.model_fingerprint(CONFIG.chosen_model),
    script:
        "../scripts/fit_by_simulator.py"


rule infer_parameters:
    """Posterior and profiles of a tissue's parameters; what a further measurement would tell."""
    input:
        fit=rules.fit_tissue.output.fit,
        mould=rules.fit_tissue.input.mould,
        weights=SURROGATE["weights"],
        model=SURROGATE["model"],
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        posterior=report(
            f"{RESULTS}/fits/{{tissue}}_posterior.json",
            caption="../report/infer_parameters.rst",
            category="Fits",
            labels={"tissue": "{tissue}", "what": "posterior"},
        ),
        points=f"{RESULTS}/fits/{{tissue}}_points.csv",
        draws=f"{RESULTS}/fits/{{tissue}}_draws.csv",
        further=report(
            f"{RESULTS}/fits/{{tissue}}_further.csv",
            caption="../report/further.rst",
            category="Fits",
            labels={"tissue": "{tissue}", "what": "further measurements"},
        ),
    log:
        f"{RESULTS}/logs/infer_parameters/{{tissue}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/infer_parameters/{{tissue}}.tsv"
    threads: 1
    resources:
        mem_mb=2500,
    params:
        points=CONFIG.fit.points,
        error=CONFIG.fit.error,
        draws=CONFIG.fit.draws,
        simulator=SIMULATOR,
    script:
        "../scripts/infer_parameters.py"


rule fit_joint:
    """Fit several tissues with common parameters, by the surrogate and by the simulator."""
    input:
        fits=expand(rules.fit_tissue.output.fit, tissue=CONFIG.fit.joint),
        moulds=[find_mould(TISSUES[tissue].mould) for tissue in CONFIG.fit.joint],
        weights=SURROGATE["weights"],
        model=SURROGATE["model"],
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        fit=f"{RESULTS}/fits/joint.json",
        table=report(
            f"{RESULTS}/fits/joint.csv",
            caption="../report/fit_joint.rst",
            category="Fits",
        ),
    log:
        f"{RESULTS}/logs/fit_joint.log",
    benchmark:
        f"{RESULTS}/benchmarks/fit_joint.tsv"
    threads: 2
    resources:
        mem_mb=2000,
    params:
        mould_scale=CONFIG.fit.mould_scale,
        starts=CONFIG.fit.starts,
        simulations=CONFIG.fit.simulations,
        simulator=SIMULATOR,
    script:
        "../scripts/fit_joint.py"


rule fit_outline:
    """Fit a simulated tissue, whose parameters are known, by its ratios and by its whole outline."""
    input:
        fit=rules.fit_tissue.output.fit,
        tissue=rules.fit_tissue.output.tissue,
        mould=rules.fit_tissue.input.mould,
        weights=SURROGATE["weights"],
        model=SURROGATE["model"],
    output:
        fit=report(
            f"{RESULTS}/fits/{{tissue}}_outline.json",
            caption="../report/fit_outline.rst",
            category="Fits",
            labels={"tissue": "{tissue}", "what": "outline"},
        ),
    log:
        f"{RESULTS}/logs/fit_outline/{{tissue}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/fit_outline/{{tissue}}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        starts=CONFIG.fit.starts,
        seed=CONFIG.seed,
    script:
        "../scripts/fit_outline.py"


rule simulate_unmeasured:
    """Simulate a tissue of which only delta is known, over the range of spring constants."""
    input:
        mould=lambda wildcards: find_mould(UNMEASURED[wildcards.unmeasured].mould),
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        table=report(
            f"{RESULTS}/fits/{{unmeasured}}_bound.csv",
            caption="../report/simulate_unmeasured.rst",
            category="Fits",
            labels={"tissue": "{unmeasured}", "what": "at its bound"},
        ),
    log:
        f"{RESULTS}/logs/simulate_unmeasured/{{unmeasured}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/simulate_unmeasured/{{unmeasured}}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    params:
        delta=lambda wildcards: UNMEASURED[wildcards.unmeasured].paper["delta"],
        mould_scale=CONFIG.fit.mould_scale,
        simulator=SIMULATOR,
    script:
        "../scripts/simulate_unmeasured.py"


# Fits by the simulator, where it may make simulations.
BY_SIMULATOR = CONFIG.fit.tissues if CONFIG.fit.simulations else ()


rule tabulate_fits:
    """All fits beside the paper's, as one table."""
    input:
        fits=expand(rules.fit_tissue.output.fit, tissue=CONFIG.fit.tissues),
        simulators=expand(rules.fit_by_simulator.output.fit, tissue=BY_SIMULATOR),
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
        simulator=lambda wildcards: (
            expand(rules.fit_by_simulator.output, tissue=wildcards.tissue)
            if BY_SIMULATOR
            else []
        ),
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


rule plot_valley:
    """Draw what two ratios leave open of three parameters, and what would narrow it."""
    input:
        fit=rules.fit_tissue.output.fit,
        posterior=rules.infer_parameters.output.posterior,
        points=rules.infer_parameters.output.points,
        draws=rules.infer_parameters.output.draws,
        further=rules.infer_parameters.output.further,
    output:
        png=report(
            f"{RESULTS}/figures/valley_{{tissue}}.png",
            caption="../report/plot_valley.rst",
            category="Fits",
            labels={"tissue": "{tissue}", "what": "valley"},
        ),
        svg=f"{RESULTS}/figures/valley_{{tissue}}.svg",
        data=f"{RESULTS}/figures/valley_{{tissue}}.csv",
    log:
        f"{RESULTS}/logs/plot_valley/{{tissue}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_valley/{{tissue}}.tsv"
    threads: 1
    resources:
        mem_mb=1000,
    script:
        "../scripts/plot_valley.py"


rule fit:
    """The fitted tissues."""
    input:
        rules.tabulate_fits.output,
        rules.fit_joint.output if CONFIG.fit.joint else [],
        expand(rules.fit_outline.output, tissue=CONFIG.fit.tissues),
        expand(rules.simulate_unmeasured.output, unmeasured=CONFIG.fit.unmeasured),
        expand(rules.plot_fit.output.png, tissue=CONFIG.fit.tissues),
        expand(rules.plot_valley.output.png, tissue=CONFIG.fit.tissues),
