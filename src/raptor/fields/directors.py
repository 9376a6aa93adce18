"""Directors: the mean axis of the cells in a square, and its strength, from the fields of S."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raptor.frame import pixel_centres
from raptor.symmetry import FIELDS


class Directors(NamedTuple):
    """A director field on a coarse grid.

    Parameters
    ----------
    centres : ndarray (n,)
        x, and y, of the grid's squares, l0.
    angle : ndarray (n, n)
        Of the principal eigenvector of the in-plane tensor, radians from x in (-pi/2, pi/2]; (y, x).
    anisotropy : ndarray (n, n)
        Difference of its two eigenvalues over density: 0 if cells are isotropic in the plane or upright, 1 if
        all lie along the director; NaN without tissue.
    """

    centres: NDArray[np.float64]
    angle: NDArray[np.float64]
    anisotropy: NDArray[np.float64]


def directors(fields: NDArray[np.floating], threshold: float, squares: int = 32) -> Directors:
    """Directors of fields (8, y, x), averaged over at most `squares` squares per side.

    Parameters
    ----------
    threshold : float
        Density per pixel above which there is tissue.
    """
    pixels = fields.shape[-1]
    width = max(1, pixels // squares)
    coarse = fields.reshape(len(FIELDS), pixels // width, width, pixels // width, width).mean((2, 4))
    named = dict(zip(FIELDS, coarse.astype(np.float64), strict=True))
    along, across = named["sxsx"] - named["sysy"], 2 * named["sxsy"]
    tissue = named["density"] > threshold
    anisotropy = np.hypot(along, across) / np.where(tissue, named["density"], np.nan)
    return Directors(pixel_centres(pixels // width), 0.5 * np.arctan2(across, along), anisotropy)
