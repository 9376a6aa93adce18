"""A tissue fitted by the surrogate, the fit corrected by simulations, and both verified."""

from collections.abc import Mapping
from dataclasses import asdict
from time import perf_counter
from typing import TYPE_CHECKING, Any

from raptor.condor.simulate import Tissue
from raptor.fitting.least_squares import STARTS, Fit, minimise
from raptor.fitting.simulator import ENOUGH, REPLICATES, Simulator, measure_again
from raptor.fitting.space_mapping import correct
from raptor.fitting.targets import Target, surrogate_measure
from raptor.moulds.geometry import Mould

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
    content = {
        "target": asdict(target),
        "surrogate": asdict(Fit.at(found)),
        "simulation": measure_again(at_fit, simulator, mould, target),
        "corrected": asdict(Fit.at(corrected)),
        "corrected_simulation": measure_again(at_corrected, simulator, mould, target),
        **seconds,
    }
    return content, at_fit[0]
