"""The model card: what a surrogate was trained on, how wrong it is, and where not to trust it."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from raptor.dataset.netcdf import LICENCE, LICENCE_URL
from raptor.parameters import DELTA, KAPPA_NNN, KAPPA_NNNN
from raptor.report.html import render
from raptor.studies.evaluation import SHAPES
from raptor.surrogate.bands import LEVELS
from raptor.symmetry import FIELDS

if TYPE_CHECKING:  # tables and figures do not wait for torch
    from raptor.surrogate.inference import Surrogate

TEMPLATE = Path(__file__).with_suffix(".md.jinja")


def model_card(
    name: str,
    data: str,
    surrogate: "Surrogate",
    training: Mapping[str, Any],
    history: pd.DataFrame,
    summaries: Mapping[str, Mapping[str, Any]],
    regions: pd.DataFrame,
    *,
    half: bool,
) -> str:
    """The card, in Markdown, of a surrogate with its training and its evaluation.

    Parameters
    ----------
    data : str
        Name of the data set.
    training : mapping
        How it was trained, as model.json has it.
    history : DataFrame
        Rows of epochs of all networks.
    summaries, regions : mapping, DataFrame
        What `evaluation.summarise` gave of the test split of each campaign, and `evaluation.regions_of`.
    half : bool
        Whether weights are stored in half precision.
    """
    content = {
        "name": name,
        "data": data,
        "surrogate": surrogate,
        "training": training,
        "passes": int(history["epoch"].max()) + 1,
        "minutes": history["seconds"].sum() / 60,
        "summaries": summaries,
        "regions": regions.to_dict("records"),
        "threshold_factor": surrogate.calibration.threshold_factor if surrogate.calibration else 1.0,
        "own_factor": surrogate.calibration.own_factor if surrogate.calibration else 1.0,
        "levels": LEVELS,
        "quantities": (*FIELDS, *SHAPES),
        "delta": DELTA,
        "kappa_nnn": KAPPA_NNN,
        "kappa_nnnn": KAPPA_NNNN,
        "half": half,
        "licence": LICENCE,
        "licence_url": LICENCE_URL,
    }
    return render(TEMPLATE.read_text(encoding="utf-8"), content, escape=False)
