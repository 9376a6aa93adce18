"""Distance of a mould and its parameters from the training set, and what is unusual about them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects, label
from scipy.spatial import KDTree

from raptor.frame import pixel_size
from raptor.parameters import BOUNDS, DELTA, KAPPA_NNN, KAPPA_NNNN, Bounds, CellParameters


class Descriptor(NamedTuple):
    """What a descriptor is called, its unit, and the quantity that it stands for."""

    words: str
    unit: str
    quantity: Callable[[float], float]

    def text(self, value: float) -> str:
        """A value of the descriptor in words."""
        return f"{self.quantity(value):.3g} {self.unit}".rstrip()


def _scaled_back(bounds: Bounds) -> Callable[[float], float]:
    return lambda value: bounds.lower + value * (bounds.upper - bounds.lower)


DESCRIPTORS = {
    "delta": Descriptor("Delta", "", _scaled_back(DELTA)),
    "kappa_nnn": Descriptor("kappa_nnn", "", _scaled_back(KAPPA_NNN)),
    "kappa_nnnn": Descriptor("kappa_nnnn", "", _scaled_back(KAPPA_NNNN)),
    "area": Descriptor("area", "l0^2", lambda side: side**2),
    "length": Descriptor("length", "l0", lambda length: length),
    "slenderness": Descriptor("ratio of length to width", "", math.exp),
    "tethers": Descriptor("number of tethers", "", lambda root: round(root**2)),
    "tether_area": Descriptor("area of all tethers", "l0^2", lambda side: side**2),
    "longest_tether": Descriptor("longest tether", "l0", lambda length: length),
}
MOULD_DESCRIPTORS = tuple(DESCRIPTORS)[3:]
"""Those of the mould alone."""


def descriptors(
    depression: NDArray[np.generic], tethers: NDArray[np.generic], parameters: CellParameters
) -> NDArray[np.float64]:
    """Descriptors (`DESCRIPTORS`,) of a mould (masks (y, x)) and its parameters, in parts of their ranges."""
    scaled = [
        (getattr(parameters, name) - bounds.lower) / (bounds.upper - bounds.lower)
        for name, bounds in BOUNDS.items()
    ]
    return np.concatenate([scaled, mould_descriptors(depression, tethers)])


def mould_descriptors(depression: NDArray[np.generic], tethers: NDArray[np.generic]) -> NDArray[np.float64]:
    """Descriptors (`MOULD_DESCRIPTORS`,) of a mould (masks (y, x)), invariant under rotation and reflection.

    Lengths in l0, areas as the side of a square, numbers as their root; slenderness is the logarithm of the
    ratio of the depression's principal axes, length four standard deviations along the longer.
    """
    size = pixel_size(depression.shape[-1])
    short, long = _principal_axes(depression, size)
    marks, count = label(np.asarray(tethers) > 0, np.ones((3, 3)))
    extents = [
        size * math.hypot(*(part.stop - part.start for part in found)) for found in find_objects(marks)
    ]
    return np.array(
        [
            size * math.sqrt(np.count_nonzero(depression)),
            4 * long,
            math.log(long / short),
            math.sqrt(count),
            size * math.sqrt(np.count_nonzero(tethers)),
            max(extents, default=0.0),
        ]
    )


def _principal_axes(mask: NDArray[np.generic], size: float) -> tuple[float, float]:
    """Standard deviations, l0, of a mask (y, x) with pixels of a size along its principal axes, ascending."""
    points = size * np.stack(np.nonzero(mask))
    if points.shape[1] < 3:
        return 1.0, 1.0
    short, long = np.sqrt(np.linalg.eigvalsh(np.cov(points)))
    return max(float(short), 1e-3), max(float(long), 1e-3)


@dataclass(frozen=True)
class TrainingSet:
    """The descriptors of a training set.

    Parameters
    ----------
    points : ndarray (n, descriptors)
        Of the training samples.
    usual : float
        Distance that 99 % of the validation samples stay below.
    """

    points: NDArray[np.float32]
    usual: float = 1.0

    @cached_property
    def deviation(self) -> NDArray[np.float32]:
        """Standard deviation (descriptors,) of the points, in which distances are measured."""
        return np.asarray(self.points.std(axis=0) + 1e-6)

    def distance(self, point: NDArray[np.float64]) -> float:
        """Distance to the nearest point over the usual one, each descriptor over its deviation."""
        return float(self._tree.query(point / self.deviation)[0]) / self.usual

    def unusual(self, point: NDArray[np.float64]) -> str:
        """The descriptor that is farthest out of the range that was trained on, its value and that range.

        Where each lies within its range, the one that differs most from the nearest training sample's.
        """
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        excess = np.maximum(low - point, point - high) / self.deviation
        number = int(excess.argmax())
        if excess[number] > 0:
            found = tuple(DESCRIPTORS.values())[number]
            lowest = found.text(low[number]).removesuffix(f" {found.unit}")
            trained_on = f"{lowest} to {found.text(high[number])}"
            return f"{found.words} {found.text(point[number])}; trained on {trained_on}"
        nearest = int(self._tree.query(point / self.deviation)[1])
        number = int((np.abs(self.points[nearest] - point) / self.deviation).argmax())
        found = tuple(DESCRIPTORS.values())[number]
        return (
            f"{found.words} {found.text(point[number])} with all else as it is; the nearest training sample "
            f"has {found.text(self.points[nearest, number])}"
        )

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.points / self.deviation)
