"""Targets of fits, and the region that is searched (paper, "Parameter fitting").

The paper's bounded region is mapped to a unit cube: delta, kappa_nnn, and kappa_nnnn between its lower bound
and the upper bound set by kappa_nnn.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from raptor.core.jobs import in_threads, processors
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.parameters import (
    BOUNDS,
    DELTA,
    KAPPA_NNN,
    KAPPA_NNNN,
    Bounds,
    CellParameters,
    largest_kappa_nnnn,
)

if TYPE_CHECKING:  # tables and figures do not wait for torch
    from raptor.surrogate.inference import Surrogate

RATIOS = ("area_ratio", "width_ratio")
PARAMETERS = tuple(BOUNDS)

Measure = Callable[[Sequence[CellParameters]], NDArray[np.float64]]
"""From n sets of parameters to measured quantities (n, k), mostly A/A0 and w/w0."""


@dataclass(frozen=True)
class Target:
    """The measured ratios of a tissue; None if not measured."""

    area_ratio: float | None
    width_ratio: float | None

    @property
    def columns(self) -> list[int]:
        """Indices of the measured ratios."""
        return [column for column, value in enumerate(self._values) if value is not None]

    def residuals(self, measured: NDArray[np.float64]) -> NDArray[np.float64]:
        """Model (..., 2) minus measured (..., 1 or 2), for the measured ratios."""
        wanted = np.array([self._values[column] for column in self.columns], dtype=float)
        return np.asarray(measured[..., self.columns] - wanted)

    def rss(self, measured: NDArray[np.float64]) -> float:
        """Residual sum of squares of measured ratios (2,)."""
        return float((self.residuals(measured) ** 2).sum())

    @property
    def _values(self) -> tuple[float | None, float | None]:
        return self.area_ratio, self.width_ratio


def parameters_at(unit: NDArray[np.float64]) -> CellParameters:
    """Parameters at a point (3,) of the unit cube."""
    return CellParameters(*values_at(unit).tolist())


def values_at(units: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same at points (..., 3), as numbers (..., 3) in the order of `PARAMETERS`."""
    delta, first, second = np.moveaxis(np.clip(units, 0.0, 1.0), -1, 0)
    kappa_nnn = _between(KAPPA_NNN.lower, KAPPA_NNN.upper, first)
    third = _between(KAPPA_NNNN.lower, _highest(kappa_nnn), second)
    return np.stack([_between(DELTA.lower, DELTA.upper, delta), kappa_nnn, third], axis=-1)


def unit_of(parameters: CellParameters) -> NDArray[np.float64]:
    """Position (3,) of parameters in the unit cube, the inverse of `parameters_at`, clipped to the cube."""
    third = Bounds(KAPPA_NNNN.lower, float(_highest(np.array(parameters.kappa_nnn))))
    bounds = (DELTA, KAPPA_NNN, third)
    values = (parameters.delta, parameters.kappa_nnn, parameters.kappa_nnnn)
    unit = [(v - b.lower) / (b.upper - b.lower) for v, b in zip(values, bounds, strict=True)]
    return np.clip(unit, 0.0, 1.0)


def as_array(parameters: Sequence[CellParameters]) -> NDArray[np.float64]:
    """Parameters as an array (n, 3), in the order of `PARAMETERS`."""
    return np.array([(p.delta, p.kappa_nnn, p.kappa_nnnn) for p in parameters])


def prior_density(units: NDArray[np.float64]) -> NDArray[np.float64]:
    """Density of the paper's distribution at points of the cube (n, 3), (n,), up to a factor.

    delta is uniform, and so are both kappas over their bounded plane: the density is the length of the strip
    at a kappa_nnn.
    """
    return _highest(values_at(units)[:, 1]) - KAPPA_NNNN.lower


def surrogate_measure(
    surrogate: "Surrogate", mould: Mould | CastMould, *, averaged: bool = False, threads: int | None = 1
) -> Measure:
    """Area and width ratio of a mould's tissue by the surrogate, from one image or averaged over D4.

    `threads` predict, each torch's on one; None: one for each processor.
    """
    cast = surrogate.cast(mould)
    densities_of = surrogate_densities(surrogate, cast, averaged=averaged, threads=threads)

    def measure(parameters: Sequence[CellParameters]) -> NDArray[np.float64]:
        return np.array([surrogate.ratios(density, cast) for density in densities_of(parameters)])

    return measure


def surrogate_densities(
    surrogate: "Surrogate", mould: Mould | CastMould, *, averaged: bool = False, threads: int | None = 1
) -> Callable[[Sequence[CellParameters]], Any]:
    """From n sets of parameters to densities (n, y, x) of a mould's tissue, by the surrogate, likewise."""
    cast = surrogate.cast(mould)

    def predicted(part: Sequence[CellParameters]) -> NDArray[np.float32]:
        return surrogate.predict(cast, part, averaged=averaged)[:, 0]

    def densities(parameters: Sequence[CellParameters]) -> NDArray[np.float32]:
        size = -(-len(parameters) // (threads or processors()))
        parts = [parameters[start : start + size] for start in range(0, len(parameters), size)]
        return np.concatenate(list(in_threads(predicted, parts, threads)))

    return densities


def _between(lower: float, upper: float | NDArray[np.float64], part: NDArray[np.float64]) -> Any:
    return lower + part * (upper - lower)


def _highest(kappa_nnn: NDArray[np.float64]) -> NDArray[np.float64]:
    """Upper end of the range of kappa_nnnn at each kappa_nnn, to which the bound is proportional."""
    return np.minimum(KAPPA_NNNN.upper, kappa_nnn * largest_kappa_nnnn(1.0))
