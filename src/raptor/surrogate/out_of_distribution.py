"""How unlike the training set a mould and its parameters are."""

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
    """Numbers (`DESCRIPTORS`,) that say what a mould (masks (y, x)) and its parameters are like.

    None of them changes when the mould is turned or mirrored. Parameters over the width of their range,
    lengths in l0, areas as lengths of a square; slenderness is the logarithm of the ratio of the
    depression's principal axes.
    """
    size = pixel_size(depression.shape[-1])
    y, x = np.nonzero(depression)
    axes = np.sqrt(np.linalg.eigvalsh(np.cov(np.stack([x, y]) * size))) if len(x) > 2 else np.ones(2)
    marks, count = label(np.asarray(tethers) > 0, np.ones((3, 3)))
    extents = [
        size * math.hypot(*(piece.stop - piece.start for piece in found)) for found in find_objects(marks)
    ]
    values = [
        (value - bounds.lower) / (bounds.upper - bounds.lower)
        for value, bounds in (
            (parameters.delta, DELTA),
            (parameters.kappa_nnn, KAPPA_NNN),
            (parameters.kappa_nnnn, KAPPA_NNNN),
        )
    ]
    return np.array(
        [
            *values,
            size * math.sqrt(len(x)),
            4 * float(axes[1]),
            math.log(max(float(axes[1]), 1e-3) / max(float(axes[0]), 1e-3)),
            math.sqrt(count),
            size * math.sqrt(np.count_nonzero(tethers)),
            max(extents, default=0.0),
        ]
    )


@dataclass(frozen=True)
class Novelty:
    """Distance to the nearest of a training set's descriptors.

    Parameters
    ----------
    points : ndarray (n, descriptors)
        Of the training samples.
    usual : float
        Distance that all but a hundredth of the validation samples stay below.
    """

    points: NDArray[np.float32]
    usual: float = 1.0

    def distance(self, seen: NDArray[np.float64]) -> float:
        """Euclidean distance over standard deviations to the nearest training sample, in what is usual."""
        deviation = self.points.std(axis=0) + 1e-6
        nearest, _ = KDTree(self.points / deviation).query(seen / deviation)
        return float(nearest) / self.usual
