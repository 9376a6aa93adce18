"""Fits as a user asks for them: to ratios or an outline, by the surrogate or the simulator."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import shapely
from numpy.typing import NDArray

from raptor.condor.simulate import PIXELS
from raptor.core.errors import RaptorError
from raptor.fields.shape import shape_ratios
from raptor.fitting.fitted import FittedTissue
from raptor.fitting.least_squares import Minimum, Residuals, minimise
from raptor.fitting.outline import Densities, Outline, deviations, outline_measure, read_outline
from raptor.fitting.posterior import RATIO_ERROR, infer, summarise, survey
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
from raptor.moulds.reading import as_mould
from raptor.parameters import CellParameters, NetworkModel, require_parameters
from raptor.raster import density_threshold
from raptor.surrogate.command import load_surrogate
from raptor.surrogate.inference import Surrogate

By = Literal["surrogate", "simulator"]
"""The model used by a fit."""

OUTLINE_ERROR = 0.25
LARGEST_RATIO = 1.5  # a tissue may swell; more is a mistake
CORRECTED = 4  # one in so many simulations may be used to correct the surrogate's fit
NORMAL = 1.96  # standard deviations to an end of a 95 % interval


@dataclass(frozen=True)
class Request:
    """A request for a fit.

    Parameters
    ----------
    mould : Mould
    target : Target or Outline
        The measurement.
    simulator : Simulator
    surrogate : Surrogate or None
        None if the simulator starts from `start`.
    start : CellParameters or None
    by_simulator : bool
        Whether the simulator continues from the surrogate's fit or from the start.
    simulations : int
        Largest number of simulations.
    error : float or None
        Standard error of a ratio, or of the outline in l0; None for the default.
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
        """Density per pixel above which there is tissue, for the model that ends the fit."""
        if self.surrogate is not None and not self.by_simulator:
            return self.surrogate.threshold
        return density_threshold(self.simulator.model.layers, self.simulator.pixels)

    def measure(self, densities: Densities, ratios: Measure, threshold: float) -> tuple[Measure, Residuals]:
        """The measured quantities and their residuals."""
        if isinstance(self.target, Outline):
            return outline_measure(densities, self.target, threshold), np.asarray
        return ratios, self.target.residuals

    def simulated(self, parameters: Sequence[CellParameters]) -> NDArray[np.float64]:
        """Densities (n, y, x) of simulated tissues."""
        runs = [self.simulator.run(self.mould, each) for each in parameters]
        return np.array([self.simulator.fields(run)[0] for run in runs])


def fit(
    mould: Mould | str | Path,
    area_ratio: float | None = None,
    width_ratio: float | None = None,
    *,
    outline: Outline | shapely.Geometry | str | Path | None = None,
    by: By = "surrogate",
    surrogate: Surrogate | str | Path | None = None,
    start: CellParameters | None = None,
    layers: int | None = None,
    accuracy: str = "standard",
    simulations: int = 40,
    error: float | None = None,
    seed: int = 0,
) -> FittedTissue:
    """Fit delta, kappa_nnn and kappa_nnnn to a measured tissue, with what the fit leaves open.

    Two ratios cannot determine three parameters; the intervals show what they leave open (docs/fits.md). For
    ratios the intervals are those of the surrogate's posterior, for an outline they follow from the
    derivatives at the fit.

    Parameters
    ----------
    mould : Mould, str or Path
        A mould, or a library name or file for `read_mould`.
    area_ratio, width_ratio : float, optional
        Measured A/A0 and w/w0, one or both.
    outline : shapely Polygon or MultiPolygon, str or Path, optional
        The tissue's outline (l0), such as from `measure`, instead of ratios; or a picture of it, cropped to
        the frame of 62.5 l0.
    by : str
        "surrogate", or "simulator" to continue from the surrogate's fit with simulations.
    surrogate : Surrogate, str, Path or None
        A surrogate or its folder; None for the shipped one.
    start : CellParameters, optional
        Start of a fit by the simulator without a surrogate.
    layers, accuracy : int, str
        Of simulations, as in `simulate`; by default the surrogate's layers, or 7 without one.
    simulations : int
        Largest number of simulations.
    error : float, optional
        Standard error of a ratio (0.01), or of the outline (0.25 l0).
    seed : int
        Of every random number.

    Raises
    ------
    RaptorError
        If an argument is not allowed, or the measurement is not possible on the mould.

    Examples
    --------
    >>> found = fit("glial_1", area_ratio=0.81, width_ratio=0.80)
    """
    start = _start(start, by)
    target, mould = _target(area_ratio, width_ratio, outline), as_mould(mould)
    used = _surrogate(surrogate, layers) if start is None else None
    model = NetworkModel(used.layers if used is not None else layers or 7)
    simulator = Simulator(model, accuracy, used.pixels if used is not None else PIXELS, seed)
    return _fit(Request(mould, target, simulator, used, start, by == "simulator", simulations, error))


def _start(start: CellParameters | None, by: str) -> CellParameters | None:
    """The start of a fit by the simulator alone, checked."""
    if by not in get_args(By):
        raise RaptorError(f"by is '{by}'; allowed are {', '.join(get_args(By))}")
    if start is None:
        return None
    if by == "surrogate":
        raise RaptorError('start parameters need a fit by the simulator: by="simulator", or --by simulator')
    return require_parameters(start).require_sampled("fit")


def _surrogate(surrogate: Surrogate | str | Path | None, layers: int | None) -> Surrogate:
    """The surrogate, loaded, and for as many layers as are asked for."""
    loaded = surrogate if isinstance(surrogate, Surrogate) else load_surrogate(surrogate)
    if layers not in (None, loaded.layers):
        raise RaptorError(
            f"layers is {layers}, but this surrogate is for {loaded.layers}; omit it, or start the "
            "simulator from your own parameters"
        )
    return loaded


def _target(
    area_ratio: float | None,
    width_ratio: float | None,
    outline: Outline | shapely.Geometry | str | Path | None,
) -> Target | Outline:
    """The measurement: ratios or an outline."""
    ratios = {"area ratio": area_ratio, "width ratio": width_ratio}
    given = {name: value for name, value in ratios.items() if value is not None}
    if bool(given) + (outline is not None) != 1:
        raise RaptorError(
            "give one kind of measurement: the area ratio, the width ratio, both, or an outline"
        )
    for name, value in given.items():
        if not 0 < value <= LARGEST_RATIO:
            raise RaptorError(
                f"the {name} is {value}; a ratio to the tissue as cast lies between 0 and {LARGEST_RATIO}"
            )
    if outline is None:
        return Target(area_ratio, width_ratio)
    if isinstance(outline, shapely.Geometry):
        return Outline.along(outline)
    return outline if isinstance(outline, Outline) else read_outline(Path(outline))


def _fit(request: Request) -> FittedTissue:
    """The requested fit."""
    found, measure, densities = _search(request)
    density = densities([found.parameters])[0]
    area, width = map(float, shape_ratios(density, request.simulator.cast(request.mould), request.threshold))
    intervals: dict[str, tuple[float, float]] = {}
    posterior: dict[str, Any] = {}
    if isinstance(request.target, Outline):
        intervals = _intervals(request, request.target, measure, found)
    elif request.surrogate is not None and request.surrogate.calibration is not None:
        posterior = _posterior(request, request.surrogate, request.target)
        quantiles = {name: known["quantiles"] for name, known in posterior["parameters"].items()}
        intervals = {name: (known["0.025"], known["0.975"]) for name, known in quantiles.items()}
    return FittedTissue(
        request.mould,
        request.target,
        "simulator" if request.by_simulator else "surrogate",
        request.simulator.model.layers,
        found,
        area,
        width,
        intervals,
        posterior.get("reachable"),
        posterior,
        density,
        request.threshold,
    )


def _search(request: Request) -> tuple[Minimum, Measure, Densities]:
    """The minimum by the surrogate, or by the simulator from there or from the start."""
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
        found = minimise(start_by, residuals, seed=seed, fine=measure)
        if not request.by_simulator:
            return found, measure, surrogate_densities(request.surrogate, request.mould, averaged=True)
        return _corrected(request, found, measure)
    assert request.start is not None, "a fit needs a surrogate or a start"
    measure, residuals = _by_simulation(request)
    found = descend_by_simulation(measure, residuals, unit_of(request.start), request.simulations)
    return found, measure, request.simulated


def _corrected(request: Request, found: Minimum, predicted: Measure) -> tuple[Minimum, Measure, Densities]:
    """The surrogate's fit corrected by simulations, then a search by the simulator with the rest."""
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
    """The measured quantities of simulated tissues and their residuals."""
    return request.measure(request.simulated, request.simulator.measure(request.mould), request.threshold)


def _posterior(request: Request, surrogate: Surrogate, target: Target) -> dict[str, Any]:
    """The posterior in numbers."""
    seen = survey(surrogate, request.mould, request.simulator.seed)
    return summarise(infer(seen, target, request.simulator.seed, request.error or RATIO_ERROR))


def _intervals(
    request: Request, outline: Outline, measure: Measure, found: Minimum
) -> dict[str, tuple[float, float]]:
    """95 % intervals of a fit to an outline, from its derivatives; none if a combination is left open."""
    step = {"step": STEP} if request.by_simulator else {}
    errors = deviations(measure, found, outline, request.error or OUTLINE_ERROR, **step)
    if not np.isfinite(errors).all():
        return {}
    middle = as_array([found.parameters])[0]
    ends = zip(PARAMETERS, middle - NORMAL * errors, middle + NORMAL * errors, strict=True)
    return {name: (float(low), float(high)) for name, low, high in ends}
