"""Moulds as images: the two mask channels that the surrogate reads."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.frame import pixel_centres
from raptor.moulds.geometry import STRICTLY, Mould, signed_depth


@dataclass(frozen=True)
class MouldImage:
    """Masks (y, x), row 0 at the lowest y: where cells may be, and where tethers stand."""

    depression: NDArray[np.bool_]
    tethers: NDArray[np.bool_]


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
