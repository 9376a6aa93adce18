"""Attachment of tissue to its tethers."""

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import KDTree

from raptor.fields.shape import outside, pixels_in
from raptor.moulds.cast import CastMould, once_per_cast
from raptor.moulds.loops import centre_of, winding

CONTACT = 1.5  # l0; tissue this near is in contact
RIM_STEP = 0.1  # l0; largest distance between points of a rim
CLOSED = 0.75
"""Least density, in thresholds, on the way from outside to a tether that the tissue as cast encircles.

With less, a gap to the wall is too narrow for a row of sites. In images of 1,245 simulated tissues this and
`OPEN` find 32 of the 34 tethers that `held` counts as lost, and 4 of the 6,268 others."""
OPEN = 0.2
"""The same of a tether that is lost. Lost ones had 0.03 or less, those held in other tissues 0.49 or more."""


def held(positions: NDArray[np.float64], cast: CastMould) -> NDArray[np.float64]:
    """Share of layers in which the tissue still encircles each tether, (tethers,).

    A layer encircles it if the smallest closed path of sites around the tether as cast still has winding
    number +-1 about its centre; layers without such a path are not counted. NaN if no layer has one, as for
    a tether that touches the outline.

    Parameters
    ----------
    positions : ndarray (cells, 2 or 3)
        Of the contracted tissue, l0, in the order of `cast.sites`.
    """
    shares = np.full(len(cast.loops), np.nan)
    for number, (tether, loops) in enumerate(zip(cast.mould.tethers, cast.loops, strict=True)):
        around = [abs(winding(positions[loop, :2], centre_of(tether))) == 1 for loop in loops]
        if around:
            shares[number] = np.mean(around)
    return shares


def contact(positions: NDArray[np.float64], cast: CastMould) -> NDArray[np.float64]:
    """Share of each tether's rim with a cell within 1.5 l0 in the plane, (tethers,).

    Parameters
    ----------
    positions : ndarray (cells, 2 or 3)
        l0.
    """
    cells = KDTree(positions[:, :2])
    distances = [cells.query(_rim(tether.polygon))[0] for tether in cast.mould.tethers]
    return np.array([np.mean(each <= CONTACT) for each in distances], dtype=np.float64)


def posts_lost(shares: NDArray[np.float64]) -> int:
    """Number of tethers held in fewer than half of the layers, from `held` (tethers,)."""
    return int(np.count_nonzero(shares < 0.5))


def seen_held(
    density: NDArray[np.floating], cast: CastMould, threshold: float | None = None
) -> NDArray[np.float64]:
    """Whether tissue encloses each tether in an image of its density (y, x): 1 or 0, (tethers,).

    The counterpart of `held` for images. NaN if the tissue as cast does not enclose the tether.
    """
    free = outside(density, OPEN * (cast.threshold if threshold is None else threshold))
    enclosed = zip(cast.tether_depths, _enclosed_as_cast(cast), strict=True)
    return np.array(
        [float(not free[pixels_in(depth)].any()) if before else np.nan for depth, before in enclosed]
    )


@once_per_cast
def _enclosed_as_cast(cast: CastMould) -> list[bool]:
    """Whether the tissue as cast encloses each tether."""
    free = outside(cast.density, CLOSED * cast.threshold)
    return [not free[pixels_in(depth)].any() for depth in cast.tether_depths]


def _rim(polygon: shapely.Polygon) -> NDArray[np.float64]:
    """Points (n, 2) evenly spaced along a tether's rim, l0."""
    rim = polygon.exterior
    places = np.arange(0, rim.length, rim.length / np.ceil(rim.length / RIM_STEP))
    return np.asarray(shapely.get_coordinates(shapely.line_interpolate_point(rim, places)))
