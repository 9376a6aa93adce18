"""Figures, each with its data; no job here predicts or trains."""

FIGURE = f"{RESULTS}/figures/{{figure}}"


# Figures that draw tables, by name.
FIRST = CONFIG.main_campaign or next(iter(CAMPAIGNS))
TABLE_FIGURES = {
    "design": dict(
        kind="design",
        inputs={
            "design": f"{RESULTS}/campaigns/{FIRST}/design.csv",
            "moulds": f"{RESULTS}/campaigns/{FIRST}/moulds.geojson",
        },
    )
}
for campaign, block in CAMPAIGNS.items():
    if block.kind == "families" or (block.files() and not block.grid):
        TABLE_FIGURES[f"outcomes_{campaign}"] = dict(
            kind="outcomes",
            inputs={
                name: expand(path, campaign=campaign)[0]
                for name, path in (
                    ("simulated", rules.tabulate_campaign.output.table),
                    ("design", rules.design_campaign.output.design),
                    ("moulds", rules.design_campaign.output.moulds),
                )
            },
        )
for campaign in SWEEPS:
    TABLE_FIGURES[f"contraction_{campaign}"] = dict(
        kind="contraction",
        inputs={
            "table": expand(rules.compare_contraction.output.table, campaign=campaign)[
                0
            ]
        },
    )
if CASES:
    TABLE_FIGURES["tradeoff"] = dict(
        kind="tradeoff", inputs={"table": rules.tabulate_tradeoff.output.table}
    )
# Figures that draw fields.
FIELD_FIGURES = {}
for campaign in SWEEPS:
    drawn = {
        "stack": expand(rules.build_stack.output.stack, campaign=campaign)[0],
        "moulds": expand(rules.design_campaign.output.moulds, campaign=campaign)[0],
        "predicted": (
            expand(rules.predict_campaign.output.fields, campaign=campaign)
            if CONFIG.has_surrogate
            else []
        ),
    }
    FIELD_FIGURES[f"directors_{campaign}"] = dict(kind="directors", inputs=drawn)
    for mould in CAMPAIGNS[campaign].files():
        FIELD_FIGURES[f"panels_{campaign}_{mould}"] = dict(
            kind="panels", inputs=drawn, options={"mould": mould}
        )
if MODELS:
    errors = {name: files[0] for name, files in ERRORS.items()}
    TABLE_FIGURES |= {
        "bulk": dict(
            kind="bulk",
            inputs={"metrics": errors["metrics"], "summary": errors["summary"]},
            options={"campaign": CONFIG.main_campaign},
        ),
        "training": dict(
            kind="training",
            inputs={"history": OWN["history"][0]},
            options={"means_until": CONFIG.means_until(CONFIG.own_model)},
        ),
        "calibration": dict(
            kind="calibration",
            inputs={"metrics": errors["metrics"], "summary": errors["summary"]},
            options={"campaign": CONFIG.main_campaign},
        ),
        "regions": dict(
            kind="regions",
            inputs={"metrics": errors["metrics"], "regions": errors["regions"]},
        ),
        "models": dict(
            kind="models",
            inputs={
                "table": rules.compare_models.output.table,
                "histories": expand(rules.assemble_model.output.history, model=MODELS),
            },
            options={"models": {name: CONFIG.means_until(name) for name in MODELS}},
        ),
    }
    learnt = [name for name in CONFIG.learnt if CAMPAIGNS[name].selected_by is None]
    TABLE_FIGURES["descriptors"] = dict(
        kind="descriptors",
        inputs={"moulds": expand(rules.design_campaign.output.moulds, campaign=learnt)},
        options={"mould_scale": CONFIG.mould_scale},
    )
    if CONFIG.compares_training:
        TABLE_FIGURES["learning"] = dict(
            kind="learning", inputs={"table": rules.compare_models.output.campaigns}
        )
    tuned = [
        name
        for name, model in MODELS.items()
        if model.initial_weights
        and model.campaigns != MODELS[model.initial_weights].campaigns
    ]
    if tuned:
        TABLE_FIGURES["active_learning"] = dict(
            kind="active_learning",
            inputs={"regions": rules.compare_models.output.regions},
            options={"models": [MODELS[tuned[0]].initial_weights, *tuned]},
        )
    samples = {
        "samples": rules.predict_samples.output.samples,
        "moulds": expand(rules.design_campaign.output.moulds, campaign=MAIN)[0],
    }
    FIELD_FIGURES |= {
        "fields": dict(kind="fields", inputs=samples),
        "worst": dict(kind="worst", inputs=samples),
    }
for tissue in TISSUES:
    fitted = rules.fit_tissue.output
    inferred = rules.infer_parameters.output
    TABLE_FIGURES[f"valley_{tissue}"] = dict(
        kind="valley",
        inputs={
            name: expand(path, tissue=tissue)[0]
            for name, path in (
                ("fit", fitted.fit),
                ("posterior", inferred.posterior),
                ("points", inferred.points),
                ("draws", inferred.draws),
                ("experimental_design", inferred.experimental_design),
            )
        },
    )
    simulator = rules.fit_by_simulator.output if tissue in BY_SIMULATOR else None
    FIELD_FIGURES[f"tissue_{tissue}"] = dict(
        kind="tissue",
        inputs={"prediction": expand(fitted.prediction, tissue=tissue)[0]},
    )
    FIELD_FIGURES[f"fit_{tissue}"] = dict(
        kind="fit",
        inputs={
            "fit": expand(fitted.fit, tissue=tissue)[0],
            "tissue": expand(fitted.tissue, tissue=tissue)[0],
            "prediction": expand(fitted.prediction, tissue=tissue)[0],
            "other_fit": expand(simulator.fit, tissue=tissue) if simulator else [],
            "other_tissue": (
                expand(simulator.tissue, tissue=tissue) if simulator else []
            ),
        },
    )


rule plot_tables:
    """Draw a figure of the run, with its data; plot_tables from tables, plot_fields from fields."""
    input:
        unpack(lambda wildcards: TABLE_FIGURES[wildcards.figure]["inputs"]),
    output:
        png=report(f"{FIGURE}.png", category="Figures", labels={"figure": "{figure}"}),
        svg=f"{FIGURE}.svg",
        data=f"{FIGURE}.csv",
    log:
        f"{RESULTS}/logs/plot_tables/{{figure}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_tables/{{figure}}.tsv"
    wildcard_constraints:
        figure="|".join(TABLE_FIGURES),
    threads: 1
    resources:
        mem_mb=2500,
    params:
        kind=lambda wildcards: TABLE_FIGURES[wildcards.figure]["kind"],
        options=lambda wildcards: TABLE_FIGURES[wildcards.figure].get("options", {}),
    script:
        "../scripts/plot_figure.py"


use rule plot_tables as plot_fields with:
    input:
        unpack(lambda wildcards: FIELD_FIGURES[wildcards.figure]["inputs"]),
    output:
        png=report(f"{FIGURE}.png", category="Figures", labels={"figure": "{figure}"}),
        svg=f"{FIGURE}.svg",
        data=f"{FIGURE}.nc",
    log:
        f"{RESULTS}/logs/plot_fields/{{figure}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/plot_fields/{{figure}}.tsv"
    wildcard_constraints:
        figure="|".join(FIELD_FIGURES) or "none",
    params:
        kind=lambda wildcards: FIELD_FIGURES[wildcards.figure]["kind"],
        options=lambda wildcards: FIELD_FIGURES[wildcards.figure].get("options", {}),


rule plot_folding:
    """Draw one tissue contracted and folded by an anneal."""
    input:
        mould=[find_mould(CASES[case].mould) for case in FOLDED],
        kernels=ancient(rules.compile_kernels.output.kernels),
    output:
        png=report(
            f"{RESULTS}/figures/folding.png",
            category="Figures",
            labels={"figure": "folding"},
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
        trial=CONFIG.trial(FOLDED[0]) if FOLDED else None,
        method=CONFIG.tradeoff.annealed[1] if FOLDED else None,
        model_version=MODEL_VERSION,
    script:
        "../scripts/plot_folding.py"


rule studies:
    """Campaigns over a grid or of moulds of one's own: what becomes of them, with figures."""
    input:
        expand(rules.tabulate_campaign.output, campaign=SWEEPS),
        expand(rules.compare_contraction.output, campaign=SWEEPS),
        expand(rules.search_moulds.output, search=CONFIG.searches),
        [
            f"{RESULTS}/figures/{figure}.png"
            for figure in (*TABLE_FIGURES, *FIELD_FIGURES)
            if figure.startswith(
                ("contraction_", "panels_", "directors_", "outcomes_")
            )
        ],


rule tradeoff:
    """Speed against accuracy."""
    input:
        (
            [
                rules.tabulate_tradeoff.output,
                f"{RESULTS}/figures/tradeoff.png",
                rules.plot_folding.output.png if FOLDED else [],
            ]
            if CASES
            else []
        ),


rule fit:
    """The fitted tissues."""
    input:
        rules.tabulate_fits.output if FITTED else [],
        rules.fit_joint.output if JOINT else [],
        expand(rules.fit_outline.output, tissue=FITTED),
        expand(
            f"{RESULTS}/figures/{{kind}}_{{tissue}}.png",
            kind=["tissue", "fit", "valley"],
            tissue=FITTED,
        ),


rule figures:
    """All figures."""
    input:
        expand(f"{FIGURE}.png", figure=[*TABLE_FIGURES, *FIELD_FIGURES]),
        rules.plot_folding.output.png if FOLDED else [],
