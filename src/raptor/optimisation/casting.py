"""From vectors to moulds that can be made and cast, or to how far they are from that."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.frame import IMAGE_SIZE
from raptor.moulds.cast import HALF_SPAN, CastMould
from raptor.moulds.geometry import CLEARANCE, Circle, Mould, Tether
from raptor.optimisation.genes import Draft, draft
from raptor.optimisation.spec import DesignSpec

BROKEN = 10.0
"""Violation of a vector that gives no outline at all."""


class QuickCast(CastMould):
    """A cast mould whose sites are found by shapes grown and shrunk by the clearance: ten times as fast."""

    @cached_property
    def planes(self) -> list[NDArray[np.float64]]:
        """Sites (n, 2) of the even and of the odd layers, l0; empty where there is none."""
        x = np.arange(-HALF_SPAN, HALF_SPAN + 1.0)
        inner = self.mould.outline.buffer(-CLEARANCE)
        shapely.prepare(inner)
        planes = []
        for parity in range(min(self.layers, 2)):
            points = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2) + 0.5 * parity
            points = points[np.abs(points).max(axis=1) < IMAGE_SIZE / 2]
            points = points[shapely.contains_xy(inner, points[:, 0], points[:, 1])]
            for tether in self.mould.tethers:
                points = points[~_within(tether, points, CLEARANCE)]
            planes.append(points)
        return planes


@dataclass(frozen=True)
class Candidate:
    """A vector's mould, and by how much it violates the process; no mould where it cannot be made."""

    cast: CastMould | None
    violation: float

    @property
    def cells(self) -> int:
        """Number of cells."""
        assert self.cast is not None
        return self.cast.n_cells


def decode(vector: NDArray[np.float64], spec: DesignSpec, layers: int, pixels: int) -> Candidate:
    """The mould of a vector (GENES,), cast with layers and imaged, or the violation that forbids it."""
    try:
        made = draft(vector, spec, layers)
    except (ValueError, shapely.GEOSException):
        return Candidate(None, BROKEN)
    violation = violation_of(made, spec, layers)
    if violation > 0:
        return Candidate(None, violation)
    try:
        mould = Mould(made.outline, made.tethers, mm_per_l0=spec.mm_per_l0)
        cast = QuickCast(mould, layers, pixels)
        return Candidate(cast if cast.image.depression.any() else None, 0.0)
    except RaptorError:
        return Candidate(None, BROKEN)


def violation_of(made: Draft, spec: DesignSpec, layers: int) -> float:
    """How far outline and tethers are from a mould: too many or few tethers, too few cells."""
    low, high = spec.tethers
    missing = float(max(low - len(made.tethers), len(made.tethers) - high, 0))
    cells = layers * (made.outline.area - sum(tether.area for tether in made.tethers))
    return float(missing + max(0.9 * spec.mould_cells[0] / max(cells, 1.0) - 1, 0.0))


def _within(tether: Tether, points: NDArray[np.float64], distance: float) -> NDArray[np.bool_]:
    """Whether points (n, 2) lie in a tether or nearer to it than a distance."""
    if isinstance(tether, Circle):
        return np.asarray(tether.depth(points) > -distance)
    grown = tether.polygon.buffer(distance)
    return np.asarray(shapely.contains_xy(grown, points[:, 0], points[:, 1]))
