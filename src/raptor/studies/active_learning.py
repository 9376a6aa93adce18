"""Active learning: runs about which the networks of an ensemble disagree most."""

from typing import TYPE_CHECKING

from raptor.dataset.campaign import Score
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters
from raptor.surrogate.bands import disagreement

if TYPE_CHECKING:  # tables and figures do not wait for torch
    from raptor.surrogate.inference import Surrogate


def disagreement_of(surrogate: "Surrogate") -> Score:
    """Score of runs: the disagreement of a surrogate's networks about density."""

    def score(mould: Mould, parameters: CellParameters) -> float:
        found = surrogate.ensemble(mould, parameters)
        return disagreement(found.deviation, found.mean)

    return score
