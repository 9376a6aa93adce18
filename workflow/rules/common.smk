"""Validation before anything runs, and what all rules share."""

import sys
from pathlib import Path

from snakemake.exceptions import WorkflowError

from raptor import config as configuration
from raptor.core.version import MODEL_VERSION
from raptor.surrogate.baselines import BASELINES
from raptor.core.compiled import source_hash
from raptor.core.errors import RaptorError
from raptor.moulds.library.tissues import load_tissues, require_measured
from raptor.moulds.reading import find_mould

if "name" not in config:
    raise WorkflowError(
        "the configuration has no name; give its results a folder by 'name: ...'"
    )
try:
    CONFIG = configuration.parse(config, "configuration")
    TISSUES = load_tissues(CONFIG.fit.tissues_file, CONFIG.fit.tissues)
    UNMEASURED = load_tissues(CONFIG.fit.tissues_file, CONFIG.fit.unmeasured)
    require_measured(TISSUES, UNMEASURED)
    configuration.require_measurable(TISSUES | UNMEASURED, CONFIG.fit.mould_scale)
    configuration.require_castable(CONFIG.tradeoff.cases, CONFIG.sweep)
except RaptorError as error:
    raise WorkflowError(str(error))
config.update(CONFIG.model_dump(mode="json"))  # captions see the defaults too

RESULTS = f"results/{CONFIG.name}"
CASES = {case.name: case for case in CONFIG.tradeoff.cases}
MODELS = CONFIG.models
ENRICHED = [name for name, model in MODELS.items() if model.extra]
SETS = CONFIG.further_sets
SWEEPS = CONFIG.sweep.files()
JUDGED = ["test", *(name for name in ("bars", "slender", "corner") if name in SETS)]
FIGURES = (
    "design",
    "fields",
    "bulk",
    "training",
    "calibration",
    "regions",
    "worst",
    "models",
    "tradeoff",
    *(["enrichment"] if ENRICHED else []),
)


wildcard_constraints:
    shard=r"\d+-\d+",
    tissue="|".join(CONFIG.fit.tissues),
    unmeasured="|".join(CONFIG.fit.unmeasured) or "none",
    figure="|".join(FIGURES),
    case="|".join(CASES),
    model="|".join([*MODELS, *BASELINES]),
    member=r"\d+",
    set="|".join(["test", *SETS]),
    sweep="|".join(SWEEPS),


localrules:
    record_configuration,


rule record_configuration:
    """Write the configuration as it was understood, defaults included, for the report."""
    output:
        configuration=report(
            f"{RESULTS}/configuration.yaml",
            caption="../report/configuration.rst",
            category="Configuration",
        ),
    log:
        f"{RESULTS}/logs/record_configuration.log",
    benchmark:
        f"{RESULTS}/benchmarks/record_configuration.tsv"
    threads: 1
    resources:
        mem_mb=200,
    params:
        configuration=CONFIG.model_dump(mode="json"),
    script:
        "../scripts/record_configuration.py"
