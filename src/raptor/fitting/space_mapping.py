"""Correction of a surrogate's fit by a few simulations (output space mapping).

The surrogate's error varies slowly with the parameters: the difference between the simulator and the
surrogate at one point is added to the surrogate, which is fitted again (Bandler et al. 2004, DOI
10.1109/TMTT.2003.820904). Each round costs one simulation; a least-squares step by the simulator itself
costs four.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raptor.fitting.least_squares import STEP, Minimum, Residuals, descend
from raptor.fitting.targets import Measure
from raptor.parameters import CellParameters

NEAR = STEP / 10  # of a range; smaller moves are not simulated again
TOLERANCE = 1e-4  # of a search by the surrogate, no finer than its steps


def correct(
    found: Minimum,
    predicted: Measure,
    simulated: Measure,
    residuals: Residuals,
    *,
    budget: int,
    enough: float,
) -> Minimum:
    """Continue from a surrogate's fit: simulate there, correct the surrogate, fit again.

    Parameters
    ----------
    found : Minimum
        The surrogate's fit.
    predicted, simulated : Measure
        The same quantities by the surrogate and by the simulator.
    budget : int
        Largest number of simulations, at least one.
    enough : float
        Residual sum of squares below which it ends.

    Returns
    -------
    Minimum
        The best simulated point; `evaluations` counts simulations, `rank` is that of the surrogate's
        derivatives.
    """
    seen: list[Minimum] = []
    there = found
    while len(seen) < budget:
        (measured,), (expected,) = (measure([there.parameters]) for measure in (simulated, predicted))
        rss = float(np.nan_to_num((residuals(measured) ** 2).sum(), nan=np.inf))
        seen.append(replace(there, measured=measured, rss=rss))
        if not enough < rss < np.inf:
            break
        shifted = _shifted(predicted, measured - expected)
        there = descend(
            shifted, residuals, there.unit, budget=10**9, step=STEP, enough=0.0, tolerance=TOLERANCE
        )
        if min(float(np.abs(there.unit - each.unit).max()) for each in seen) < NEAR:
            break
    return replace(min(seen, key=lambda each: each.rss), evaluations=len(seen))


def _shifted(measure: Measure, shift: NDArray[np.float64]) -> Measure:
    """A measure with a constant added; NaN in the shift count as zero."""

    def shifted(parameters: Sequence[CellParameters]) -> NDArray[np.float64]:
        return measure(parameters) + np.nan_to_num(shift)

    return shifted
