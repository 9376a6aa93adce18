"""Moulds as images: the two mask channels of the surrogate's input."""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from raptor.core.errors import RaptorError
from raptor.frame import pixel_centres
from raptor.moulds.geometry import STRICTLY, Mould, Tether, signed_depth


@dataclass(frozen=True)
class MouldImage:
    """Masks (y, x), row 0 at the lowest y: where cells may lie, and where tethers are."""

    depression: NDArray[np.bool_]
    tethers: NDArray[np.bool_]


def mould_image(mould: Mould, pixels: int) -> MouldImage:
    """Masks of a mould: a pixel belongs to the region that contains its centre (paper, "Machine Learning").

    Raises
    ------
    RaptorError
        If the depression covers no pixel.
    """
    outline = _strictly_inside(mould.outline, pixels)
    tethers = np.zeros_like(outline)
    for tether in mould.tethers:
        tethers |= tether_depth(tether, pixels, reach=1.0) >= -STRICTLY
    tethers &= outline
    depression = outline & ~tethers
    if not depression.any():
        raise RaptorError(
            f"{mould.name} covers no pixel centre of a {pixels} x {pixels} image; draw it larger"
        )
    return MouldImage(depression, tethers)


def tether_depth(tether: Tether, pixels: int, reach: float) -> NDArray[np.float64]:
    """Depth of pixel centres (y, x) in a tether, l0; -inf at some of those further than `reach` outside."""
    centres = pixel_centres(pixels)
    x0, y0, x1, y1 = tether.polygon.bounds
    rows, columns = (
        np.flatnonzero((centres >= low - reach) & (centres <= high + reach))
        for low, high in ((y0, y1), (x0, x1))
    )
    depth = np.full((pixels, pixels), -np.inf)
    points = np.stack(np.meshgrid(centres[columns], centres[rows]), axis=-1)
    depth[np.ix_(rows, columns)] = tether.depth(points.reshape(-1, 2)).reshape(len(rows), len(columns))
    return depth


def _strictly_inside(polygon: shapely.Polygon, pixels: int) -> NDArray[np.bool_]:
    """Pixels (y, x) whose centres lie inside a polygon, not on its boundary.

    Distances are computed only for pixels beside the boundary.
    """
    centres = pixel_centres(pixels)
    points = np.stack(np.meshgrid(centres, centres), axis=-1)
    shapely.prepare(polygon)
    inside = shapely.contains_xy(polygon, points[..., 0], points[..., 1])
    rim = maximum_filter(inside, 3) & ~minimum_filter(inside, 3)
    inside[rim] = signed_depth(polygon, points[rim]) > STRICTLY
    return np.asarray(inside)
