"""Validation before anything runs, and names shared by all rules."""

import shlex
import sys
from pathlib import Path

from snakemake.exceptions import WorkflowError

from raptor.config import checked
from raptor.core.compiled import source_hash
from raptor.core.errors import RaptorError
from raptor.core.jobs import hold_lock
from raptor.core.version import MODEL_VERSION
from raptor.moulds.reading import find_mould
from raptor.surrogate.rules import BASELINES

if "name" not in config:
    raise WorkflowError(
        "the configuration has no name; give its results a folder by 'name: ...'"
    )
try:
    CONFIG, TISSUES = checked(
        config,
        "configuration",
        [Path(file).parent for file in reversed(workflow.configfiles)],
    )
except RaptorError as error:
    raise WorkflowError(str(error))

# Snakemake gives this path to a shell without quotes.
if " " in sys.executable:
    sys.executable = shlex.quote(sys.executable)

RESULTS = f"results/{CONFIG.name}"
CAMPAIGN = f"{RESULTS}/campaigns/{{campaign}}"
STUDY = f"{RESULTS}/studies/{{campaign}}"
CAMPAIGNS = CONFIG.campaigns
MODELS = CONFIG.models
SWEEPS = [name for name, campaign in CAMPAIGNS.items() if campaign.grid]
CASES = CONFIG.tradeoff.cases
SIMULATOR = {**CONFIG.simulator, "pixels": CONFIG.pixels, "seed": CONFIG.seed}


wildcard_constraints:
    campaign="|".join(CAMPAIGNS),
    shard=r"\d+-\d+",
    model="|".join([*MODELS, *BASELINES, CONFIG.given_model or "none"]),
    member=r"\d+",
    tissue="|".join(TISSUES) or "none",
    case="|".join(CASES) or "none",
    search="|".join(CONFIG.searches) or "none",


onstart:
    # One run at a time makes a folder of results: a second would remove files that the first reads.
    try:
        hold_lock(Path(".snakemake", f"{CONFIG.name}.lock"), RESULTS)
    except RaptorError as error:
        raise WorkflowError(str(error))
