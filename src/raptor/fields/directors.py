"""Directors: the mean axis of the cells in a square, and its strength, from the fields of S."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raptor.frame import pixel_centres
from raptor.moulds.cast import CastMould
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


def alignment(fields: NDArray[np.floating], cast: CastMould) -> float:
    """Alignment of cells with the mould from fields (8, y, x), -1 to 1: see `cell_alignment`."""
    return alignment_along(fields, long_side(cast))


def alignment_along(fields: NDArray[np.floating], angle: float) -> float:
    """The same along a direction, as an angle from x in radians."""
    named = dict(zip(FIELDS, fields.sum(axis=(1, 2), dtype=np.float64), strict=True))
    return _alignment(named["sxsx"], named["sysy"], named["sxsy"], angle)


def long_side(cast: CastMould) -> float:
    """Direction of a mould's long side, radians from x."""
    _, half = cast.long_axis
    return float(np.arctan2(half[1], half[0]))


def cell_alignment(orientation: NDArray[np.float64], cast: CastMould) -> float:
    """Alignment with the mould of cells (cells, 3): 1 where all lie along its long side, -1 across it.

    The sum of (s.a)^2 - (s.b)^2 over that of (s.a)^2 + (s.b)^2, with a along the long side and b across it in
    the plane; NaN where all cells stand upright.
    """
    sx, sy, _ = orientation.T
    return _alignment(float(sx @ sx), float(sy @ sy), float(sx @ sy), long_side(cast))


def anisotropy(fields: NDArray[np.floating]) -> float:
    """How far cells line up locally, whatever the direction, from fields (8, y, x): 0 to 1.

    The sum over pixels of sqrt((SxSx - SySy)^2 + 4 SxSy^2) over that of SxSx + SySy.
    """
    named = dict(zip(FIELDS, fields, strict=True))
    sizes = np.hypot(named["sxsx"] - named["sysy"], 2 * named["sxsy"])
    return _share(sizes.sum(dtype=np.float64), (named["sxsx"] + named["sysy"]).sum(dtype=np.float64))


def _alignment(sxsx: float, sysy: float, sxsy: float, angle: float) -> float:
    along = np.cos(2 * angle) * (sxsx - sysy) + 2 * np.sin(2 * angle) * sxsy
    return _share(along, sxsx + sysy)


def _share(part: float, whole: float) -> float:
    return float(part / whole) if whole > 0 else float("nan")
