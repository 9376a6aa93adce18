"""Sweeps of the parameters on standard moulds: contraction, densities, directors."""


rule design_sweep:
    """A run for every point and seed of a mould's sweep."""
    input:
        mould=lambda wildcards: find_mould(SWEEPS[wildcards.sweep]),
    output:
        design=f"{RESULTS}/sweeps/{{sweep}}/design.csv",
        moulds=f"{RESULTS}/sweeps/{{sweep}}/moulds.geojson",
    log:
        f"{RESULTS}/logs/design_sweep/{{sweep}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/design_sweep/{{sweep}}.tsv"
    threads: 1
    resources:
        mem_mb=500,
    params:
        sweep=CONFIG.sweep.model_dump(mode="json"),
        seed=CONFIG.seed,
    script:
        "../scripts/design_sweep.py"


use rule simulate_shard as simulate_sweep with:
    input:
        design=rules.design_sweep.output.design,
        moulds=rules.design_sweep.output.moulds,
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        shard=f"{RESULTS}/sweeps/{{sweep}}/{{shard}}.nc",
    log:
        f"{RESULTS}/logs/simulate_sweep/{{sweep}}/{{shard}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/simulate_sweep/{{sweep}}/{{shard}}.tsv"
    params:
        configuration=CONFIG.sweep_fingerprint(),
        layers=CONFIG.model.layers,
        shells=CONFIG.model.shells,
        tension=CONFIG.model.tension,
        accuracy=CONFIG.simulation.accuracy,


rule measure_sweep:
    """Area and central width of every simulation of a sweep."""
    input:
        design=rules.design_sweep.output.design,
        moulds=rules.design_sweep.output.moulds,
        shards=expand(
            rules.simulate_sweep.output.shard,
            shard=CONFIG.shards_of(CONFIG.sweep.grid().size),
            allow_missing=True,
        ),
    output:
        table=f"{RESULTS}/sweeps/{{sweep}}/simulated.csv",
    log:
        f"{RESULTS}/logs/measure_sweep/{{sweep}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/measure_sweep/{{sweep}}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
    params:
        layers=CONFIG.model.layers,
        pixels=CONFIG.fields.pixels,
        configuration=CONFIG.sweep_fingerprint(),
    script:
        "../scripts/measure_sweep.py"


rule predict_sweep:
    """Area and central width at every point of a sweep by the surrogate, with its bands."""
    input:
        moulds=rules.design_sweep.output.moulds,
        weights=SURROGATE["weights"],
        model=SURROGATE["model"],
    output:
        table=f"{RESULTS}/sweeps/{{sweep}}/predicted.csv",
    log:
        f"{RESULTS}/logs/predict_sweep/{{sweep}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/predict_sweep/{{sweep}}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        sweep=CONFIG.sweep.model_dump(mode="json"),
    script:
        "../scripts/predict_sweep.py"


rule compare_sweep:
    """Contraction simulated and predicted, the largest difference and where it is."""
    input:
        simulated=expand(rules.measure_sweep.output.table, sweep=SWEEPS),
        predicted=expand(rules.predict_sweep.output.table, sweep=SWEEPS),
    output:
        table=report(
            f"{RESULTS}/sweeps/contraction.csv",
            caption="../report/contraction.rst",
            category="Sweeps",
        ),
        differences=report(
            f"{RESULTS}/sweeps/differences.json",
            caption="../report/differences.rst",
            category="Sweeps",
        ),
    log:
        f"{RESULTS}/logs/compare_sweep.log",
    benchmark:
        f"{RESULTS}/benchmarks/compare_sweep.tsv"
    threads: 1
    resources:
        mem_mb=800,
    script:
        "../scripts/compare_sweep.py"


rule plot_contraction:
    """The paper's contraction curves, simulated and predicted."""
    input:
        table=rules.compare_sweep.output.table,
    output:
        png=report(
            f"{RESULTS}/figures/contraction.png",
            caption="../report/plot_contraction.rst",
            category="Sweeps",
        ),
        svg=f"{RESULTS}/figures/contraction.svg",
        data=f"{RESULTS}/figures/contraction.csv",
    log:
        f"{RESULTS}/logs/plot_contraction.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_contraction.tsv"
    threads: 1
    resources:
        mem_mb=1000,
    script:
        "../scripts/plot_contraction.py"


rule plot_panels:
    """The paper's density panels of a mould, simulated over predicted."""
    input:
        design=rules.design_sweep.output.design,
        moulds=rules.design_sweep.output.moulds,
        shards=rules.measure_sweep.input.shards,
        weights=SURROGATE["weights"],
    output:
        png=report(
            f"{RESULTS}/figures/panels_{{sweep}}.png",
            caption="../report/plot_panels.rst",
            category="Sweeps",
            labels={"mould": "{sweep}", "what": "densities"},
        ),
        svg=f"{RESULTS}/figures/panels_{{sweep}}.svg",
        data=f"{RESULTS}/figures/panels_{{sweep}}.nc",
    log:
        f"{RESULTS}/logs/plot_panels/{{sweep}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_panels/{{sweep}}.tsv"
    threads: 1
    resources:
        mem_mb=2500,
    params:
        sweep=CONFIG.sweep.model_dump(mode="json"),
        configuration=CONFIG.sweep_fingerprint(),
    script:
        "../scripts/plot_panels.py"


rule plot_directors:
    """Orientation as directors over density, in the middle of the grid's spring constants."""
    input:
        designs=expand(rules.design_sweep.output.design, sweep=SWEEPS),
        moulds=expand(rules.design_sweep.output.moulds, sweep=SWEEPS),
        shards=expand(rules.measure_sweep.input.shards, sweep=SWEEPS),
        weights=SURROGATE["weights"],
    output:
        png=report(
            f"{RESULTS}/figures/directors.png",
            caption="../report/plot_directors.rst",
            category="Sweeps",
        ),
        svg=f"{RESULTS}/figures/directors.svg",
        data=f"{RESULTS}/figures/directors.nc",
    log:
        f"{RESULTS}/logs/plot_directors.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_directors.tsv"
    threads: 1
    resources:
        mem_mb=2500,
    params:
        sweep=CONFIG.sweep.model_dump(mode="json"),
        configuration=CONFIG.sweep_fingerprint(),
    script:
        "../scripts/plot_directors.py"


rule sweep:
    """Contraction over the parameters, simulated and predicted, with its figures."""
    input:
        [
            rules.compare_sweep.output,
            rules.plot_contraction.output.png,
            rules.plot_directors.output.png,
        ]
        if SWEEPS
        else [],
        expand(rules.plot_panels.output.png, sweep=SWEEPS),
