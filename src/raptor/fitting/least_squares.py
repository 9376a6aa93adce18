"""Bounded non-linear least squares over the paper's region, by a surrogate or by the simulator.

The residual sum of squares of area ratio and central width ratio is minimised (paper, "Parameter fitting").
With three parameters and two numbers the minimum is a valley, which the rank of the problem shows.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import qmc

from raptor.core.errors import RaptorError
from raptor.fitting.targets import Measure, parameters_at
from raptor.parameters import CellParameters

STEP = 0.02  # of a finite difference, over a bound's width
STARTS = 128  # points of the Sobol sequence from which starting points are chosen
REFINED = 4  # starting points that are refined
MOST_STEPS = 30
WITHIN = (1e-6, 1 - 1e-6)  # SciPy needs a start strictly within the bounds
TOLERANCE = 1e-3  # of singular values: change of a ratio across the whole range of a parameter

Residuals = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""From measured quantities (..., k) to residuals (..., m)."""


@dataclass(frozen=True)
class Minimum:
    """The minimum of the residual sum of squares.

    Parameters
    ----------
    unit : ndarray (3,)
        Position in the unit cube of `targets.parameters_at`.
    measured : ndarray (k,)
        The measured quantities there.
    rss : float
        Residual sum of squares.
    rank : int
        Number of combinations of the three parameters that the residuals determine there.
    evaluations : int
        Points at which the model was evaluated.
    """

    unit: NDArray[np.float64]
    measured: NDArray[np.float64]
    rss: float
    rank: int
    evaluations: int

    @property
    def parameters(self) -> CellParameters:
        """Parameters there."""
        return parameters_at(self.unit)


@dataclass(frozen=True)
class Fit:
    """A fitted tissue.

    Parameters
    ----------
    parameters : CellParameters
        At the minimum.
    area_ratio, width_ratio : float
        Of the model there.
    rss : float
        Residual sum of squares.
    rank : int
        How many combinations of the three parameters the measurements determine there.
    evaluations : int
        Predictions or simulations made.
    """

    parameters: CellParameters
    area_ratio: float
    width_ratio: float
    rss: float
    rank: int
    evaluations: int

    @classmethod
    def at(cls, minimum: Minimum) -> "Fit":
        """A minimum of area and width ratio as a fit."""
        area, width = (float(value) for value in minimum.measured)
        return cls(minimum.parameters, area, width, minimum.rss, minimum.rank, minimum.evaluations)


class _Enough(Exception):  # noqa: N818 - no error: a search that ends
    """The budget is spent, or the residuals are below the noise."""


class _Memory:
    """Evaluated points of the cube, each once, until a budget is spent or a fit is good enough."""

    def __init__(self, measure: Measure, residuals: Residuals, budget: int, enough: float) -> None:
        self.measure, self.residuals, self.budget, self.enough = measure, residuals, budget, enough
        self.points: dict[bytes, NDArray[np.float64]] = {}
        self.measured: dict[bytes, NDArray[np.float64]] = {}
        self.jacobians: dict[bytes, NDArray[np.float64]] = {}

    def __len__(self) -> int:
        return len(self.points)

    def residuals_at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Residuals (n, m) at points (n, 3)."""
        keys = [point.tobytes() for point in points]
        new = {key: point for key, point in zip(keys, points, strict=True) if key not in self.points}
        if len(self) + len(new) > self.budget:
            raise _Enough
        if new:
            answers = self.measure([parameters_at(point) for point in new.values()])
            self.points |= {key: point.copy() for key, point in new.items()}
            self.measured |= dict(zip(new, answers, strict=True))
        found = self.residuals(np.stack([self.measured[key] for key in keys]))
        if ((found**2).sum(axis=-1) < self.enough).any() and self.jacobians:
            raise _Enough
        return found

    def jacobian(self, unit: NDArray[np.float64], step: float) -> NDArray[np.float64]:
        """Forward differences (m, 3), backward at the upper bound."""
        steps = np.where(unit + step <= 1, step, -step)
        here, *moved = self.residuals_at(np.stack([unit, *(unit + np.diag(steps))]))
        columns = [(there - here) / width for there, width in zip(moved, steps, strict=True)]
        self.jacobians[unit.tobytes()] = np.nan_to_num(np.stack(columns, axis=1))
        return self.jacobians[unit.tobytes()]

    def best(self) -> Minimum:
        """The best of all evaluated points."""
        costs = {key: _cost(self.residuals(measured)) for key, measured in self.measured.items()}
        key = min(costs, key=costs.__getitem__)
        last = next(reversed(self.jacobians.values()), np.zeros((1, 3)))
        rank = int(np.linalg.matrix_rank(self.jacobians.get(key, last), tol=TOLERANCE))
        return Minimum(self.points[key], self.measured[key], costs[key], rank, len(self))


def minimise(
    measure: Measure, residuals: Residuals, *, seed: int, starts: int = STARTS, fine: Measure | None = None
) -> Minimum:
    """Search the whole region with a cheap model, from the best of many points that fill it.

    Parameters
    ----------
    fine : Measure, optional
        A better model, which continues from where `measure` ended.
    starts : int
        Points of a Sobol sequence at which the model is evaluated first (a power of two); the best four are
        refined.

    Raises
    ------
    RaptorError
        If none of the measurements is possible on the mould.
    """
    memory = _Memory(measure, residuals, 10**9, 0.0)
    points = qmc.Sobol(3, seed=seed).random(starts)
    costs = np.array([_cost(each) for each in memory.residuals_at(points)])
    if not np.isfinite(costs).any():
        raise RaptorError(
            "none of the measured ratios can be computed on this mould: a tether may fill its central "
            "section; give the area ratio alone, or another mould"
        )
    for start in np.argsort(costs)[:REFINED]:
        if np.isfinite(costs[start]):
            _descend(memory, points[start], STEP, 1e-8)
    best = memory.best()
    if fine is None:
        return best
    last = descend(fine, residuals, best.unit, budget=10**9, step=STEP, enough=0.0, tolerance=1e-8)
    return replace(last, evaluations=last.evaluations + best.evaluations)


def descend(
    measure: Measure,
    residuals: Residuals,
    start: NDArray[np.float64],
    *,
    budget: int,
    step: float,
    enough: float,
    tolerance: float,
) -> Minimum:
    """Descend from a point (3,) of the unit cube, with a model that may be expensive and noisy.

    Parameters
    ----------
    budget : int
        Largest number of evaluations; each step takes four.
    step : float
        Of finite differences, over a bound's width.
    enough : float
        Residual sum of squares below which the search ends.
    tolerance : float
        Relative step and relative gain below which it ends.

    Raises
    ------
    RaptorError
        If the model gives no ratio at the start.
    """
    memory = _Memory(measure, residuals, max(budget, 1), enough)
    start = np.clip(start, *WITHIN)
    if not np.isfinite(_cost(memory.residuals_at(start[None])[0])):
        raise RaptorError(
            "none of the measured ratios can be computed at the start of the search; start from a smaller "
            "delta, or give the area ratio alone"
        )
    _descend(memory, start, step, tolerance)
    return memory.best()


def _descend(memory: _Memory, start: NDArray[np.float64], step: float, tolerance: float) -> None:
    """SciPy's trust region reflective method within the cube; evaluations stay in memory."""

    def residuals(unit: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(memory.residuals_at(unit[None])[0])

    def jacobian(unit: NDArray[np.float64]) -> NDArray[np.float64]:
        return memory.jacobian(unit, step)

    try:
        least_squares(
            residuals,
            np.clip(start, *WITHIN),
            jacobian,
            bounds=(0, 1),
            x_scale=0.3,
            xtol=tolerance,
            ftol=tolerance,
            max_nfev=MOST_STEPS,
        )
    except _Enough:
        return


def _cost(residuals: NDArray[np.float64]) -> float:
    """Residual sum of squares; infinite if a ratio is missing."""
    total = float((residuals**2).sum())
    return total if np.isfinite(total) else np.inf
