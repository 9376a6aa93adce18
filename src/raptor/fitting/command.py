"""Fits as a user asks for them: to ratios or an outline, by the surrogate or the simulator."""

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import get_args

import numpy as np
import shapely

from raptor.condor.simulate import PIXELS, Tissue
from raptor.core.errors import RaptorError
from raptor.fitting.fitted import FittedTissue
from raptor.fitting.least_squares import STEP as SMALL_STEP
from raptor.fitting.least_squares import Minimum, descend, minimise
from raptor.fitting.outline import OUTLINE_ERROR, Outline, deviations, drawn_outline, read_outline
from raptor.fitting.posterior import RATIO_ERROR, Posterior, infer, summarise, survey
from raptor.fitting.request import By, Request
from raptor.fitting.simulator import ENOUGH, STEP, Simulator, descend_by_simulation
from raptor.fitting.space_mapping import correct
from raptor.fitting.targets import PARAMETERS, Measure, Target, as_array, unit_of
from raptor.moulds.geometry import Mould
from raptor.moulds.reading import as_mould
from raptor.parameters import LAYERS, CellParameters, NetworkModel, require_parameters
from raptor.surrogate.bands import NORMAL
from raptor.surrogate.command import load_surrogate
from raptor.surrogate.inference import Surrogate
from raptor.surrogate.prediction import Prediction

LARGEST_RATIO = 1.5  # a tissue may swell; more is a mistake
CORRECTED = 4  # of a fit by the simulator, one in so many simulations may correct the surrogate's fit
SIMULATIONS: dict[str, int] = {"surrogate": 0, "corrected": 3, "simulator": 40}
DRAWS = 200  # from the posterior, to draw
EXACT = 1e-7  # residual sum of squares of ratios right to 0.0003, more than a surrogate knows
TOLERANCE = 1e-3  # of a search by the surrogate; a flat valley is long, and less gains nothing


def fit(
    mould: Mould | str | Path,
    area_ratio: float | None = None,
    width_ratio: float | None = None,
    *,
    outline: Outline | shapely.Geometry | str | Path | None = None,
    by: By = "corrected",
    surrogate: Surrogate | str | Path | None = None,
    start: CellParameters | None = None,
    layers: int | None = None,
    accuracy: str = "standard",
    simulations: int | None = None,
    error: float | None = None,
    seed: int = 0,
    on_progress: Callable[[str], None] = lambda note: None,
) -> FittedTissue:
    """Fit delta, kappa_nnn and kappa_nnnn to a measured tissue, with what the fit leaves open.

    Intervals are those of the posterior (docs/fits.md), widened to hold the fit where it lies at a bound, or
    for an outline follow from the derivatives.

    Parameters
    ----------
    mould : Mould, str or Path
        A mould, or what `read_mould` reads.
    area_ratio, width_ratio : float, optional
        Measured A/A0 and w/w0, one or both.
    outline : shapely Polygon or MultiPolygon, str or Path, optional
        The tissue's outline (l0) instead of ratios, or a picture of it, cropped to the frame of 62.5 l0.
    by : str
        "surrogate"; "corrected": its error at the fit taken away by a few simulations; or "simulator".
    surrogate : Surrogate, str, Path or None
        A surrogate or its folder; None for the shipped one.
    start : CellParameters, optional
        Start of a fit by the simulator without a surrogate.
    layers, accuracy, seed
        Of simulations, as in `simulate`; by default the surrogate's layers, or 7 without one.
    simulations : int, optional
        Largest number of simulations: 3 of a corrected fit, 40 of one by the simulator.
    error : float, optional
        Standard error of a ratio (0.01), or of the outline (0.25 l0).
    on_progress : callable, optional
        Called with a note after each step.

    Raises
    ------
    RaptorError
        If an argument is not allowed, the surrogate is not calibrated, or the measurement is not possible on
        the mould.

    Examples
    --------
    >>> found = fit("glial_1", area_ratio=0.81, width_ratio=0.80)
    """
    error, start = _error(error), _start(start, by)
    target, mould = _target(area_ratio, width_ratio, outline), as_mould(mould)
    used = _surrogate(surrogate, layers) if start is None else None
    model = NetworkModel(used.layers if used is not None else LAYERS if layers is None else layers)
    simulator = Simulator(model, accuracy, used.pixels if used is not None else PIXELS, seed)
    budget = _budget(simulations, by)
    return _fit(Request(mould, target, simulator, used, start, by, budget, error, on_progress))


def _error(error: float | None) -> float | None:
    """The standard error of the measurement, checked."""
    if error is not None and not 0 < error < np.inf:
        raise RaptorError(f"error is {error}; give a positive number, the standard error of the measurement")
    return error


def _budget(simulations: int | None, by: By) -> int:
    """The largest number of simulations, checked."""
    if simulations is None:
        return SIMULATIONS[by]
    if simulations < 1 and by != "surrogate":
        raise RaptorError(f'simulations is {simulations}; give 1 or more, or by="surrogate"')
    return simulations


def _start(start: CellParameters | None, by: str) -> CellParameters | None:
    """The start of a fit by the simulator alone, checked."""
    if by not in get_args(By):
        raise RaptorError(f"by is '{by}'; allowed are {', '.join(get_args(By))}")
    if start is None:
        return None
    if by != "simulator":
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
    loaded.require_calibration()
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
        return drawn_outline(outline)
    return outline if isinstance(outline, Outline) else read_outline(Path(outline))


def _fit(request: Request) -> FittedTissue:
    """The requested fit."""
    target, surrogate, posterior = request.target, request.surrogate, None
    if surrogate is None or isinstance(target, Outline):
        found = _search(request)
    else:
        found, posterior = _search_ratios(request, surrogate, target)
    intervals = _intervals(request, target, found) if isinstance(target, Outline) else {}
    known = {} if posterior is None else summarise(posterior)
    if posterior is not None:
        for name, value in asdict(found.parameters).items():  # at a bound it lies beyond all quantiles
            quantiles = known["parameters"][name]["quantiles"]
            intervals[name] = min(quantiles["0.025"], value), max(quantiles["0.975"], value)
    return FittedTissue(
        request.mould,
        target,
        request.by,
        request.simulator.model.layers,
        len(request.tissues),
        found,
        _tissue(request, found.parameters),
        intervals,
        known,
        np.empty((0, 3)) if posterior is None else posterior.parameters[posterior.draws(DRAWS, 0)],
    )


def _tissue(request: Request, parameters: CellParameters) -> Tissue | Prediction:
    """The tissue at the fit, by the model that ended it."""
    if request.by != "surrogate":
        return request.simulate(parameters)
    assert request.surrogate is not None
    return request.surrogate.examine(request.mould, parameters)


def _search_ratios(request: Request, surrogate: Surrogate, target: Target) -> tuple[Minimum, Posterior]:
    """The fit to ratios and its posterior.

    The search by the surrogate starts in the middle of the valley. Where simulations end it, the
    surrogate's error at the best of them is taken from its predictions everywhere.
    """
    seed, error = request.simulator.seed, request.error or RATIO_ERROR
    seen = survey(surrogate, request.mould, seed, on_progress=request.on_progress)
    posterior = infer(seen, target, seed, error)
    predicted, residuals = request.predicted(averaged=True)
    found = descend(
        predicted, residuals, posterior.middle,
        budget=10**9, step=SMALL_STEP, enough=EXACT, tolerance=TOLERANCE,
    )  # fmt: skip
    request.on_progress("fit by the surrogate")
    if request.by == "surrogate":
        return found, posterior
    found = _corrected(request, found, predicted)
    shift = found.measured - predicted([found.parameters])[0]
    return found, infer(seen.shifted(shift), target, seed, error)


def _search(request: Request) -> Minimum:
    """The fit to an outline, or by the simulator from the start that was given."""
    if request.surrogate is None:
        assert request.start is not None, "a fit needs a surrogate or a start"
        measure, residuals = request.simulated()
        return descend_by_simulation(measure, residuals, unit_of(request.start), request.simulations)
    start_by, residuals = request.predicted(averaged=False)
    predicted, _ = request.predicted(averaged=True)
    found = minimise(start_by, residuals, seed=request.simulator.seed, fine=predicted)
    request.on_progress("fit by the surrogate")
    return found if request.by == "surrogate" else _corrected(request, found, predicted)


def _corrected(request: Request, found: Minimum, predicted: Measure) -> Minimum:
    """The surrogate's fit corrected by simulations, and by the simulator searched on from there."""
    measure, residuals = request.simulated()
    budget = request.simulations if request.by == "corrected" else max(1, request.simulations // CORRECTED)
    best = correct(found, predicted, measure, residuals, budget=budget, enough=ENOUGH)
    left = request.simulations - best.evaluations
    if request.by == "simulator" and best.rss > ENOUGH and left > 0:
        last = descend_by_simulation(measure, residuals, best.unit, left)
        spent = best.evaluations + last.evaluations
        best = replace(min(best, last, key=lambda each: each.rss), evaluations=spent)
    return best


def _intervals(request: Request, outline: Outline, found: Minimum) -> dict[str, tuple[float, float]]:
    """95 % intervals of a fit to an outline, from its derivatives; none if a combination is left open."""
    by_simulator = request.by == "simulator"
    measure, _ = request.simulated() if by_simulator else request.predicted(averaged=True)
    step = {"step": STEP} if by_simulator else {}
    errors = deviations(measure, found, outline, request.error or OUTLINE_ERROR, **step)
    if not np.isfinite(errors).all():
        return {}
    middle = as_array([found.parameters])[0]
    ends = zip(PARAMETERS, middle - NORMAL * errors, middle + NORMAL * errors, strict=True)
    return {name: (float(low), float(high)) for name, low, high in ends}
