"""Distance of a mould and its parameters from the training set."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects, label
from scipy.spatial import KDTree

from raptor.frame import pixel_size
from raptor.parameters import DELTA, KAPPA_NNN, KAPPA_NNNN, CellParameters

DESCRIPTORS = (
    "delta", "kappa_nnn", "kappa_nnnn", "area", "length", "slenderness", "tethers", "tether_area",
    "longest_tether",
)  # fmt: skip


def descriptors(
    depression: NDArray[np.generic], tethers: NDArray[np.generic], parameters: CellParameters
) -> NDArray[np.float64]:
    """Descriptors (`DESCRIPTORS`,) of a mould (masks (y, x)) and its parameters.

    They are invariant under rotation and reflection. Parameters are over the width of their range, lengths
    in l0, areas as the side of a square; slenderness is the logarithm of the ratio of the depression's
    principal axes.
    """
    size = pixel_size(depression.shape[-1])
    short, long = _principal_axes(depression, size)
    marks, count = label(np.asarray(tethers) > 0, np.ones((3, 3)))
    extents = [
        size * math.hypot(*(part.stop - part.start for part in found)) for found in find_objects(marks)
    ]
    values = (parameters.delta, parameters.kappa_nnn, parameters.kappa_nnnn)
    return np.array(
        [
            *(
                (value - bounds.lower) / (bounds.upper - bounds.lower)
                for value, bounds in zip(values, (DELTA, KAPPA_NNN, KAPPA_NNNN), strict=True)
            ),
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

    def distance(self, point: NDArray[np.float64]) -> float:
        """Distance to the nearest point over the usual one, each descriptor over its deviation."""
        deviation = self.points.std(axis=0) + 1e-6
        nearest, _ = KDTree(self.points / deviation).query(point / deviation)
        return float(nearest) / self.usual
