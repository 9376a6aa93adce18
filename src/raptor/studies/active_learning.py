"""Where to spend further simulations: where the networks of an ensemble disagree most."""

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from raptor.dataset.design import DesignRules, Run
from raptor.dataset.further import further_set
from raptor.moulds.geometry import Mould
from raptor.moulds.random_moulds import RandomMoulds
from raptor.surrogate.bands import disagreement

if TYPE_CHECKING:  # tables and figures do not wait for torch
    from raptor.surrogate.inference import Surrogate


def enriched(
    surrogate: "Surrogate",
    size: int,
    candidates: int,
    rules: DesignRules,
    drawn: RandomMoulds,
    seed: int,
    on_progress: Callable[[int], None] = lambda number: None,
) -> tuple[list[Run], list[Mould], pd.DataFrame]:
    """Training runs, and their moulds: of candidates drawn like the design those of the largest disagreement.

    Also returns the candidates as a table: parameters, disagreement about density, whether chosen.
    """
    runs, moulds = further_set("enriched", candidates, [], {}, rules, drawn, seed)
    disagreements = []
    for run, mould in zip(runs, moulds, strict=True):
        found = surrogate.ensemble(mould, run.parameters)
        disagreements.append(disagreement(found.deviation, found.mean))
        on_progress(run.simulation)
    chosen = np.sort(np.argsort(disagreements)[::-1][:size])
    table = pd.DataFrame([{"mould": run.mould} | asdict(run.parameters) for run in runs])
    table["disagreement"] = disagreements
    table["chosen"] = np.isin(np.arange(candidates), chosen)
    kept = [replace(runs[number], simulation=place) for place, number in enumerate(chosen)]
    return kept, [moulds[number] for number in chosen], table
