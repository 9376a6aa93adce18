"""A tissue fitted by the surrogate, the fit corrected by simulations, and both verified."""

from collections.abc import Mapping
from dataclasses import asdict
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from raptor.condor.simulate import Tissue
from raptor.fitting.least_squares import STARTS, Fit, minimise
from raptor.fitting.simulator import ENOUGH, REPLICATES, Simulator, measure_again
from raptor.fitting.space_mapping import correct
from raptor.fitting.targets import RATIOS, Target, surrogate_measure
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters

if TYPE_CHECKING:  # tables and figures do not wait for torch
    from raptor.surrogate.inference import Surrogate

CORRECTIONS = 6  # simulations; more did not help (docs/fits.md)


def fit_tissue(
    surrogate: "Surrogate",
    simulator: Simulator,
    mould: Mould,
    target: Target,
    *,
    starts: int = STARTS,
    corrections: int = CORRECTIONS,
    replicates: int = REPLICATES,
    published: CellParameters | None = None,
) -> tuple[Mapping[str, Any], Tissue]:
    """Both fits as JSON, and the first simulation, with a new seed, at the surrogate's fit.

    Parameters
    ----------
    starts : int
        As in `least_squares.minimise`.
    corrections : int
        Largest number of simulations for the correction.
    replicates : int
        Simulations with new seeds at each fit.
    published : CellParameters, optional
        Another fit, the paper's, to be simulated with the same new seeds.
    """
    begun = perf_counter()
    cast = surrogate.cast(mould)
    coarse, fine = (surrogate_measure(surrogate, cast, averaged=averaged) for averaged in (False, True))
    found = minimise(coarse, target.residuals, starts=starts, seed=simulator.seed, fine=fine)
    fitted = perf_counter()
    measure = simulator.measure(mould)
    corrected = correct(found, fine, measure, target.residuals, budget=corrections, enough=ENOUGH)
    seconds = {"surrogate_seconds": fitted - begun, "corrected_seconds": perf_counter() - fitted}
    at_fit, at_corrected = (
        simulator.replicates(mould, each.parameters, replicates) for each in (found, corrected)
    )
    content: dict[str, Any] = {
        "target": asdict(target),
        "surrogate": asdict(Fit.at(found)),
        "simulation": measure_again(at_fit, simulator, mould, target),
        "corrected": asdict(Fit.at(corrected)),
        "corrected_simulation": measure_again(at_corrected, simulator, mould, target),
        **seconds,
    }
    if published is not None:
        again = simulator.replicates(mould, published, replicates)
        content["published_simulation"] = measure_again(again, simulator, mould, target)
    return content, at_fit[0]


def common_error(surrogate: "Surrogate", mould: Mould, content: Mapping[str, Any]) -> NDArray[np.float64]:
    """Simulated less predicted ratios (2,) at the corrected fit of `fit_tissue`: the error common to a mould.

    The surrogate's error varies slowly with the parameters, so that at the fit it holds for all of them.
    """
    at = CellParameters(**content["corrected"]["parameters"])
    (predicted,) = surrogate_measure(surrogate, surrogate.cast(mould), averaged=True)([at])
    simulated = [content["corrected_simulation"][name] for name in RATIOS]
    return np.asarray(np.array(simulated, dtype=float) - predicted[: len(RATIOS)])
