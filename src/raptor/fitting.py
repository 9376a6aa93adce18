"""Fitting cell and matrix parameters to a tissue (paper, "Parameter fitting").

The residual sum of squares of area ratio and central width ratio is minimised within the paper's
bounds. Three parameters and two numbers: the minimum is a valley, and the rank of the problem says so.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import qmc

from raptor.condor.accuracy import Simulation
from raptor.condor.lattice import cast_sites
from raptor.errors import RaptorError
from raptor.fields import rasterise
from raptor.files import atomic_path
from raptor.morphology import area_ratio, density_threshold, shape_ratios, width_ratio
from raptor.moulds.geometry import Mould
from raptor.moulds.raster import mould_image
from raptor.parameters import (
    DELTA,
    KAPPA_NNN,
    KAPPA_NNNN,
    CellParameters,
    NetworkModel,
    largest_kappa_nnnn,
)
from raptor.surrogate.inference import Surrogate

STEP = 0.02  # of a finite difference, over a bound's width: the area counts whole pixels

Measure = Callable[[Sequence[CellParameters]], NDArray[np.float64]]
"""From parameters to (n, 2): area ratio and central width ratio of each."""


@dataclass(frozen=True)
class Target:
    """What was measured on a tissue; None where it was not."""

    area_ratio: float | None
    width_ratio: float | None

    def residuals(self, measured: NDArray[np.float64]) -> NDArray[np.float64]:
        """Measured (..., 2) less target (..., 1 or 2), for what the target has."""
        wanted = [self.area_ratio, self.width_ratio]
        columns = [column for column, value in enumerate(wanted) if value is not None]
        return np.asarray(measured[..., columns] - np.array([wanted[c] for c in columns], dtype=float))


@dataclass(frozen=True)
class Fit:
    """A fitted tissue.

    Parameters
    ----------
    parameters : CellParameters
        At the least cost found.
    area_ratio, width_ratio : float
        Of the model there.
    rss : float
        Residual sum of squares.
    rank : int
        How many combinations of the three parameters the measurements determine there.
    evaluations : int
        Predictions made.
    """

    parameters: CellParameters
    area_ratio: float
    width_ratio: float
    rss: float
    rank: int
    evaluations: int


def parameters_at(unit: NDArray[np.float64]) -> CellParameters:
    """The paper's bounded region as a cube: (0..1)^3 to parameters with kappa_nnnn in its bound."""
    delta, first, second = (float(v) for v in np.clip(unit, 0.0, 1.0))
    kappa_nnn = KAPPA_NNN.lower + first * (KAPPA_NNN.upper - KAPPA_NNN.lower)
    top = min(KAPPA_NNNN.upper, largest_kappa_nnnn(kappa_nnn))
    return CellParameters(
        DELTA.lower + delta * (DELTA.upper - DELTA.lower),
        kappa_nnn,
        KAPPA_NNNN.lower + second * (top - KAPPA_NNNN.lower),
    )


def surrogate_measure(surrogate: Surrogate, mould: Mould) -> Measure:
    """Area and width ratio of a mould's tissue as the surrogate predicts them, from one image for speed."""
    cells = len(cast_sites(mould, surrogate.layers))
    image = mould_image(mould, surrogate.pixels)
    threshold = density_threshold(surrogate.layers, surrogate.pixels)

    def measure(parameters: Sequence[CellParameters]) -> NDArray[np.float64]:
        fields = surrogate.predict(image.depression, image.tethers, parameters, cells, averaged=False)
        densities = fields[:, 0]
        return np.array(
            [
                (area_ratio(density, image, threshold), width_ratio(density, mould, threshold))
                for density in densities
            ]
        )

    return measure


def fit(measure: Measure, target: Target, *, starts: int, seed: int) -> Fit:
    """Bounded non-linear least squares from the best of many points that fill the region.

    Parameters
    ----------
    starts : int
        Points of a Sobol sequence at which the model is evaluated first (a power of two); the
        best four are refined.

    Raises
    ------
    RaptorError
        Where the mould allows none of the measurements.
    """
    points = qmc.Sobol(3, seed=seed).random(starts)
    measured = measure([parameters_at(point) for point in points])
    costs = (target.residuals(measured) ** 2).sum(axis=-1)
    costs = np.where(np.isfinite(costs), costs, np.inf)
    count = starts

    if not np.isfinite(costs).any():
        raise RaptorError(
            "nothing of what was measured can be measured on this mould: a tether may fill its central "
            "section; give the area ratio alone, or another mould"
        )

    def residuals(unit: NDArray[np.float64]) -> NDArray[np.float64]:
        nonlocal count
        count += 1
        return target.residuals(measure([parameters_at(unit)])[0])

    def jacobian(unit: NDArray[np.float64]) -> NDArray[np.float64]:
        nonlocal count
        count += 4
        steps = np.where(unit + STEP <= 1, STEP, -STEP)
        points = [unit, *(unit + np.diag(steps))]
        here, *moved = target.residuals(measure([parameters_at(point) for point in points]))
        return np.stack([(there - here) / step for there, step in zip(moved, steps, strict=True)], axis=1)

    refined = [
        least_squares(residuals, points[start], jacobian, bounds=(0, 1), x_scale=0.3, max_nfev=30)
        for start in np.argsort(costs)[:4]
    ]
    best = min(refined, key=lambda result: float(result.cost))
    parameters = parameters_at(best.x)
    area, width = (float(v) for v in measure([parameters])[0])
    rank = int(np.linalg.matrix_rank(np.asarray(best.jac), tol=1e-3))
    return Fit(parameters, area, width, 2 * float(best.cost), rank, count)


def write_fit(path: Path, content: dict[str, Any]) -> None:
    """Write a fit as JSON."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n")


def measure_simulation(
    simulation: Simulation, mould: Mould, model: NetworkModel, pixels: int, target: Target
) -> dict[str, float]:
    """Area ratio, width ratio and residual sum of squares of a simulated tissue."""
    density = rasterise(simulation.positions, simulation.orientation, simulation.tension, pixels)[0]
    area, width = shape_ratios(density, mould, model.layers)
    rss = float((target.residuals(np.array([area, width])) ** 2).sum())
    return {"area_ratio": area, "width_ratio": width, "rss": rss}


def tabulate(fits: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Fits as rows: target, surrogate's fit, its re-simulation, and the paper's, side by side."""
    rows = []
    for content in fits:
        target = Target(**content["target"])
        paper = content["paper"]
        row: dict[str, Any] = {"tissue": content["tissue"]}
        row |= {f"target_{key}": value for key, value in content["target"].items()}
        row |= content["surrogate"]["parameters"]
        for source in ("surrogate", "simulation"):
            row |= {f"{source}_{key}": content[source][key] for key in ("area_ratio", "width_ratio", "rss")}
        row["determined"] = content["surrogate"]["rank"]
        if {"area_ratio", "width_ratio"} <= paper.keys():
            residuals = target.residuals(np.array([paper["area_ratio"], paper["width_ratio"]]))
            row["paper_simulation_rss"] = float((residuals**2).sum())
        row |= {f"paper_{key}": value for key, value in paper.items()}
        rows.append(row)
    return pd.DataFrame(rows)
