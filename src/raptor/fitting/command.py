"""A fit as a user asks for it: ratios or an outline, by the surrogate or by the simulator."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.fields.shape import shape_ratios
from raptor.fitting.least_squares import Minimum, Residuals, minimise
from raptor.fitting.outline import Densities, Outline, deviations, outline_measure
from raptor.fitting.posterior import infer, summarise, survey
from raptor.fitting.simulator import ENOUGH, STEP, Simulator, descend_by_simulation
from raptor.fitting.space_mapping import correct
from raptor.fitting.targets import (
    PARAMETERS,
    Measure,
    Target,
    as_array,
    surrogate_densities,
    surrogate_measure,
    unit_of,
)
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters
from raptor.raster import density_threshold

if TYPE_CHECKING:  # tables and figures do not wait for torch
    from raptor.surrogate.inference import Surrogate

STARTS = 128
POINTS = 128  # of the survey behind intervals
RATIO_ERROR, OUTLINE_ERROR = 0.01, 0.25
CORRECTED = 4  # the part of simulations that correct the surrogate's fit is one over this
NORMAL = 1.96  # standard deviations to an end of a 95 % interval


@dataclass(frozen=True)
class Request:
    """What is asked for.

    Parameters
    ----------
    mould : Mould
    target : Target or Outline
        What was measured.
    simulator : Simulator
    surrogate : Surrogate or None
        None where the simulator starts from `start`.
    start : CellParameters or None
    by_simulator : bool
        Whether the simulator goes on from the surrogate's fit or the start.
    simulations : int
        That it may make.
    error : float or None
        Standard error of a ratio, or of the outline in l0; None for the usual one.
    """

    mould: Mould
    target: Target | Outline
    simulator: Simulator
    surrogate: "Surrogate | None"
    start: CellParameters | None
    by_simulator: bool
    simulations: int
    error: float | None

    @property
    def threshold(self) -> float:
        """Density per pixel above which there is tissue, as what the fit ends with gives densities."""
        if self.surrogate is not None and not self.by_simulator:
            return self.surrogate.threshold
        return density_threshold(self.simulator.model.layers, self.simulator.pixels)

    def measure(self, densities: Densities, ratios: Measure, threshold: float) -> tuple[Measure, Residuals]:
        """What is measured of tissues, and what the fit makes small of it."""
        if isinstance(self.target, Outline):
            return outline_measure(densities, self.target, threshold), np.asarray
        return ratios, self.target.residuals

    def simulated(self, parameters: Sequence[CellParameters]) -> NDArray[np.float64]:
        """Densities (n, y, x) of simulated tissues."""
        runs = [self.simulator.run(self.mould, each) for each in parameters]
        return np.array([self.simulator.fields(run)[0] for run in runs])


def fit_for(request: Request) -> tuple[dict[str, Any], NDArray[np.floating]]:
    """The fit as JSON holds it, and the density (y, x) of the tissue there.

    `intervals` hold 95 % of each parameter: for ratios those of the posterior by the surrogate, where it is
    calibrated; for an outline those that its slope at the fit gives; `reachable` is None where nothing tells.

    Raises
    ------
    RaptorError
        Where what was measured cannot be measured on the mould.
    """
    found, measure, densities = _search(request)
    density = densities([found.parameters])[0]
    area, width = map(float, shape_ratios(density, request.simulator.cast(request.mould), request.threshold))
    fitted = {
        "parameters": asdict(found.parameters),
        "area_ratio": area,
        "width_ratio": width,
        "rss": found.rss,
        "rank": found.rank,
        "evaluations": found.evaluations,
    }
    content: dict[str, Any] = {
        "mould": request.mould.name,
        "by": "simulator" if request.by_simulator else "surrogate",
        "layers": request.simulator.model.layers,
        "target": asdict(request.target if isinstance(request.target, Target) else Target(None, None)),
        "fit": fitted,
        "intervals": {},
        "reachable": None,
    }
    if isinstance(request.target, Outline):
        fitted["distance"] = float(np.sqrt(found.rss))
        content["intervals"] = _intervals(request, request.target, measure, found)
    elif request.surrogate is not None and request.surrogate.calibration is not None:
        content |= _posterior(request, request.surrogate, request.target)
    return content, density


def _search(request: Request) -> tuple[Minimum, Measure, Densities]:
    """The minimum, by the surrogate, or from there or the start on by the simulator."""
    if request.surrogate is None and (request.start is None or not request.by_simulator):
        raise RaptorError("a fit needs a surrogate, or parameters from which the simulator starts")
    start = None if request.start is None else unit_of(request.start)
    if request.surrogate is not None:
        (start_by, residuals), (measure, _) = (
            request.measure(
                surrogate_densities(request.surrogate, request.mould, averaged=averaged),
                surrogate_measure(request.surrogate, request.mould, averaged=averaged),
                request.surrogate.threshold,
            )
            for averaged in (False, True)
        )
        seed = request.simulator.seed
        found = minimise(start_by, residuals, starts=STARTS, seed=seed, fine=measure)
        if not request.by_simulator:
            return found, measure, surrogate_densities(request.surrogate, request.mould, averaged=True)
        return _corrected(request, found, measure)
    assert start is not None
    measure, residuals = _by_simulation(request)
    return descend_by_simulation(measure, residuals, start, request.simulations), measure, request.simulated


def _corrected(request: Request, found: Minimum, predicted: Measure) -> tuple[Minimum, Measure, Densities]:
    """The surrogate's fit corrected by simulations, and then a search by the simulator with those left."""
    measure, residuals = _by_simulation(request)
    budget = max(1, request.simulations // CORRECTED)
    best = correct(found, predicted, measure, residuals, budget=budget, enough=ENOUGH)
    left = request.simulations - best.evaluations
    if best.rss > ENOUGH and left > 0:
        last = descend_by_simulation(measure, residuals, best.unit, left)
        spent = best.evaluations + last.evaluations
        best = replace(min(best, last, key=lambda each: each.rss), evaluations=spent)
    return best, measure, request.simulated


def _by_simulation(request: Request) -> tuple[Measure, Residuals]:
    """What is measured of simulated tissues, and what the fit makes small of it."""
    return request.measure(request.simulated, request.simulator.measure(request.mould), request.threshold)


def _posterior(request: Request, surrogate: "Surrogate", target: Target) -> dict[str, Any]:
    """Intervals of the posterior, and whether the target can be reached."""
    seen = survey(surrogate, request.mould, POINTS, request.simulator.seed)
    summary = summarise(infer(seen, target, request.error or RATIO_ERROR, request.simulator.seed))
    ends = {
        name: {"lower": found["quantiles"]["0.025"], "upper": found["quantiles"]["0.975"]}
        for name, found in summary["parameters"].items()
    }
    return {"intervals": ends, "reachable": summary["reachable"], "posterior": summary}


def _intervals(
    request: Request, outline: Outline, measure: Measure, found: Minimum
) -> dict[str, dict[str, float]]:
    """95 % intervals of a fit to an outline, by its slope; none where a combination is left open."""
    step = {"step": STEP} if request.by_simulator else {}
    errors = deviations(measure, found, outline, request.error or OUTLINE_ERROR, **step)
    if not np.isfinite(errors).all():
        return {}
    middle = as_array([found.parameters])[0]
    ends = zip(PARAMETERS, middle - NORMAL * errors, middle + NORMAL * errors, strict=True)
    return {name: {"lower": float(low), "upper": float(high)} for name, low, high in ends}
