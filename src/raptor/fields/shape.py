"""Area and width of a tissue from its density (paper, "Model parameters and predictive capability").

Both are relative to the same tissue as cast, at the same threshold, so they are 1 before contraction in
every mould. A thin tether enclosed by tissue counts as tissue in both. Relative to the mould, as in the
paper's words, they would depend on where walls fall between rows of the lattice; `mould_ratios` gives those.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import label, map_coordinates

from raptor.frame import pixel_size
from raptor.moulds.cast import CastMould, central_section, once_per_cast, thin_parts
from raptor.moulds.geometry import CLEARANCE, Mould

Window = tuple[slice, slice]

SAMPLES_PER_PIXEL = 4  # along a section
ENCLOSING = 0.5  # of the threshold; even a single row of cells, below the threshold, encloses a tether
GAP = 0.75  # l0, around a thin tether: mean distance of a wall from the first row of cells


def shape_ratios(
    density: NDArray[np.floating], cast: CastMould, threshold: float | None = None
) -> NDArray[np.float64]:
    """A/A0 and w/w0, (2,), of a tissue from its density (y, x) in its mould.

    A/A0 is the ratio of areas above the threshold, w/w0 that of lengths on the central section, both with
    thin tethers filled and interpolated between pixels. A/A0 is NaN if cells are too sparse to be seen, w/w0
    if the section holds no tissue, as cast or contracted.

    Parameters
    ----------
    threshold : float or None
        Density per pixel above which there is tissue; None for `cast.threshold`, that of the tissue as cast.
    """
    tissue, (whole, width) = filled(density, cast, threshold), _as_cast(cast)
    area = area_above(tissue) / whole if whole > 0 else np.nan
    return np.array([area, _ratio(_length(tissue, [cast.central_section]), width)])


@once_per_cast
def _as_cast(cast: CastMould) -> tuple[float, float]:
    """Area, in pixels, and length on the central section, l0, of the tissue as cast."""
    before = filled(cast.density, cast)
    return area_above(before), _length(before, [cast.central_section])


def section_ratio(
    density: NDArray[np.floating],
    cast: CastMould,
    lines: Sequence[shapely.LineString],
    threshold: float | None = None,
) -> float:
    """Length of tissue on sections through the image over that as cast; NaN if either has none."""
    tissue, before = filled(density, cast, threshold), filled(cast.density, cast)
    return _ratio(_length(tissue, lines), _length(before, lines))


def filled(
    density: NDArray[np.floating], cast: CastMould, threshold: float | None = None
) -> NDArray[np.floating]:
    """Density (y, x) minus the threshold, made positive in thin tethers enclosed by tissue.

    This includes the gap of up to 0.75 l0 between tether and tissue, which is the mean width at casting and
    as blurred as the tether. Towards the outside only the quarter l0 counts in which no cell was cast.
    """
    threshold = cast.threshold if threshold is None else threshold
    above, free = density - threshold, outside(density, ENCLOSING * threshold)
    gap = np.where(outside(density, threshold), CLEARANCE, GAP)
    for window, depth in _thin_tethers(cast):
        if not free[window][pixels_in(depth)].any():
            above[window] = np.maximum(above[window], threshold * (depth + gap[window]))
    return above


@once_per_cast
def _thin_tethers(cast: CastMould) -> list[tuple[Window, NDArray[np.float64]]]:
    """Where each thin tether can fill tissue, and its depth there, l0."""
    windows = [_around(depth > -1 - GAP) for depth in cast.thin_tethers]
    return [(window, depth[window]) for window, depth in zip(windows, cast.thin_tethers, strict=True)]


def pixels_in(depth: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Pixels (y, x) with their centre in a tether, given their depth in it; else the one nearest to it."""
    return depth >= min(0.0, float(depth.max()))


def outside(density: NDArray[np.floating], level: float) -> NDArray[np.bool_]:
    """Pixels (y, x) joined to the image's border by pixels at or below a level of density."""
    tissue = density > level
    window, free = _around(tissue), ~tissue
    marks, _ = label(np.pad(free[window], 1, constant_values=True))
    free[window] = (marks == marks[0, 0])[1:-1, 1:-1]
    return free


def _around(there: NDArray[np.bool_]) -> Window:
    """The part of an image that holds the pixels of a mask and their neighbours: the rest costs time."""
    rows, columns = (np.flatnonzero(there.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return slice(1), slice(1)
    return slice(max(rows[0] - 1, 0), rows[-1] + 2), slice(max(columns[0] - 1, 0), columns[-1] + 2)


def area_above(values: NDArray[np.floating]) -> float:
    """Area, in pixels, where an image (y, x) given at pixel centres is positive, by interpolation.

    Each square between four pixel centres is split into four triangles, over which values are linear.
    Counting pixels would err by half a row along a straight wall.
    """
    padded = np.pad(values[_around(values > 0)].astype(np.float64), 1, mode="edge")
    corners = np.stack([padded[:-1, :-1], padded[:-1, 1:], padded[1:, 1:], padded[1:, :-1]])
    positive = (corners > 0).sum(axis=0)
    share = (positive == 4).astype(np.float64)
    mixed = (positive > 0) & (positive < 4)
    around, centre = corners[:, mixed], corners[:, mixed].mean(axis=0)
    share[mixed] = np.mean([_positive_part(around[i], around[i - 1], centre) for i in range(4)], axis=0)
    share[[0, -1]] /= 2  # half of these squares lies outside the image
    share[:, [0, -1]] /= 2
    return float(share.sum())


def _positive_part(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Share (n,) of each triangle where the linear interpolant of its corner values is positive."""
    low, middle, high = np.sort(np.stack([a, b, c]), axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        one = high**2 / ((high - middle) * (high - low))
        two = 1 - low**2 / ((middle - low) * (high - low))
    return np.select([low > 0, middle > 0, high > 0], [np.ones_like(low), two, one], 0.0)


def _length(above: NDArray[np.floating], lines: Sequence[shapely.LineString]) -> float:
    """Length of sections, l0, where an image (y, x) is positive.

    The ends follow by linear interpolation between samples.
    """
    return sum(_length_on(above, line) for line in lines)


def _ratio(length: float, before: float) -> float:
    return length / before if min(length, before) > 0 else float("nan")


def _length_on(above: NDArray[np.floating], section: shapely.LineString) -> float:
    pixels = above.shape[-1]
    step = pixel_size(pixels) / SAMPLES_PER_PIXEL
    # The centre is a sample, so that mirror images are sampled alike.
    count = int(section.length / 2 / step)
    along = np.arange(-count, count + 1) * step
    (x0, y0), (x1, y1) = section.coords
    x = (x0 + x1) / 2 + along * (x1 - x0) / section.length
    y = (y0 + y1) / 2 + along * (y1 - y0) / section.length
    middle = (pixels - 1) / 2
    rows, columns = (middle + c / pixel_size(pixels) for c in (y, x))
    values = map_coordinates(above, [rows, columns], order=1, mode="constant", cval=-1.0)
    return _length_above(values) * step


def _length_above(values: NDArray[np.floating]) -> float:
    """Length, in samples, over which a piecewise linear function is positive."""
    left, right = values[:-1], values[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.maximum(left, right) / np.abs(left - right)
    lengths = np.where((left > 0) & (right > 0), 1.0, np.where((left > 0) | (right > 0), share, 0.0))
    return float(lengths.sum())


def mould_ratios(
    density: NDArray[np.floating], cast: CastMould, threshold: float | None = None
) -> NDArray[np.float64]:
    """A/A0 and w/w0, (2,), relative to the mould, as in the paper's words; tethers never count as tissue.

    w/w0 is NaN if the central section holds no depression.
    """
    above = density - (cast.threshold if threshold is None else threshold)
    width = _length(above, [cast.central_section])
    area = np.count_nonzero(above > 0) / np.count_nonzero(cast.depression)
    return np.array([area, width / _depression_width(cast.mould)])


def outline_ratios(tissue: shapely.Geometry, mould: Mould) -> tuple[float, float]:
    """A/A0 and w/w0 of a tissue given by its outline, l0, relative to the mould as drawn; w/w0 may be NaN.

    For photographs: a real gel fills its mould, the lattice only to within half a spacing. Thin tethers
    enclosed by tissue count as tissue, as in `shape_ratios`.
    """
    seen, gel = with_thin_tethers(tissue, mould), with_thin_tethers(mould.depression, mould)
    widths = [float(central_section(mould).intersection(shape).length) for shape in (seen, gel)]
    return float(seen.area / gel.area), _ratio(*widths)


def with_thin_tethers(tissue: shapely.Geometry, mould: Mould) -> shapely.Geometry:
    """The tissue's outline with enclosed thin tethers and the gaps around them, as in `filled`."""
    whole, near = (
        shapely.union_all([shapely.Polygon(part.exterior) for part in shapely.get_parts(shape)])
        for shape in (tissue, tissue.buffer(CLEARANCE))
    )
    held = [part for part in thin_parts(mould) if near.covers(part)]
    return shapely.union_all([tissue, *held, *(whole.intersection(part.buffer(GAP)) for part in held)])


def _depression_width(mould: Mould) -> float:
    """Length of depression on the central section, l0; NaN without any."""
    length = float(central_section(mould).intersection(mould.depression).length)
    return length if length >= 1e-9 else float("nan")
