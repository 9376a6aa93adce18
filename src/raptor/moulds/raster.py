"""Moulds as images: the two mask channels that the surrogate reads."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raptor.errors import RaptorError
from raptor.moulds.geometry import IMAGE_SIZE, STRICTLY, Mould, signed_depth


@dataclass(frozen=True)
class MouldImage:
    """Masks (y, x), row 0 at the lowest y: where cells may be, and where tethers stand."""

    depression: NDArray[np.bool_]
    tethers: NDArray[np.bool_]


def pixel_size(pixels: int) -> float:
    """Side of a pixel, l0."""
    return IMAGE_SIZE / pixels


def pixel_centres(pixels: int) -> NDArray[np.float64]:
    """Coordinates of pixel centres along one axis, ascending, (pixels,), l0."""
    return np.asarray((np.arange(pixels) - (pixels - 1) / 2) * pixel_size(pixels))


def mould_image(mould: Mould, pixels: int) -> MouldImage:
    """Masks of a mould: a pixel belongs to what its centre lies in (paper, "Machine Learning").

    Raises
    ------
    RaptorError
        Where the depression covers no pixel.
    """
    centres = pixel_centres(pixels)
    x, y = np.meshgrid(centres, centres)
    points = np.column_stack([x.ravel(), y.ravel()])
    outline = signed_depth(mould.outline, points) > STRICTLY
    tethers = np.zeros(len(points), dtype=bool)
    for tether in mould.tethers:
        tethers |= tether.depth(points) >= -STRICTLY
    tethers &= outline
    depression = outline & ~tethers
    if not depression.any():
        raise RaptorError(
            f"{mould.name} covers no pixel centre of a {pixels} x {pixels} image; draw it larger"
        )
    return MouldImage(depression.reshape(x.shape), tethers.reshape(x.shape))
