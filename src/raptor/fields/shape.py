"""Area and width of a tissue (paper, "Model parameters and predictive capability"), from its density.

Both are taken over the same tissue as cast, at the same threshold, so that they are 1 before contraction in
every mould. A thin tether that tissue encloses counts as tissue in both. Over the mould, as the paper words
it, they would depend on where walls fall between rows of the lattice; `mould_ratios` gives those.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import label, map_coordinates

from raptor.frame import pixel_size
from raptor.moulds.cast import CastMould, central_section, thin_parts
from raptor.moulds.geometry import CLEARANCE, Mould

SAMPLES_PER_PIXEL = 4  # along a section
ENCLOSING = 0.5  # of the threshold: a single row of cells is less dense than that, and encloses
GAP = 0.75  # l0, around a thin tether: the mean distance of a wall from the first row of cells


def shape_ratios(
    density: NDArray[np.floating], cast: CastMould, threshold: float | None = None
) -> NDArray[np.float64]:
    """A/A0 and w/w0, (2,), of a tissue from its density (y, x) in its mould.

    A/A0 is of areas above the threshold, w/w0 of lengths on the central section, thin tethers filled in both
    and interpolated between pixels. A/A0 is NaN where cells are too sparse to be seen, w/w0 where the section
    holds no tissue, as cast or as contracted.

    Parameters
    ----------
    threshold : float or None
        Density per pixel above which there is tissue; None for `cast.threshold`, that of the tissue as cast.
    """
    tissue, before = filled(density, cast, threshold), filled(cast.density, cast)
    lines = [cast.central_section]
    whole = area_above(before)
    area = area_above(tissue) / whole if whole > 0 else np.nan
    return np.array([area, _ratio(_length(tissue, lines), _length(before, lines))])


def section_ratio(
    density: NDArray[np.floating],
    cast: CastMould,
    lines: Sequence[shapely.LineString],
    threshold: float | None = None,
) -> float:
    """Length of tissue on sections through the image over that as cast; NaN where either has none."""
    tissue, before = filled(density, cast, threshold), filled(cast.density, cast)
    return _ratio(_length(tissue, lines), _length(before, lines))


def filled(
    density: NDArray[np.floating], cast: CastMould, threshold: float | None = None
) -> NDArray[np.floating]:
    """Density (y, x) less the threshold; positive too in thin tethers that tissue encloses.

    With them goes the gap of up to 0.75 l0 between tether and tissue: as wide as cast ones are on average
    and as blurred as the tether. Towards the outside only the quarter l0 counts in which no cell was cast.
    """
    threshold = cast.threshold if threshold is None else threshold
    above, free = density - threshold, outside(density, ENCLOSING * threshold)
    gap = np.where(outside(density, threshold), CLEARANCE, GAP)
    for depth in cast.thin_tethers:
        if not free[depth >= 0].any():
            above = np.maximum(above, threshold * (depth + gap))
    return above


def outside(density: NDArray[np.floating], level: float) -> NDArray[np.bool_]:
    """Pixels (y, x) that pixels of no more than a level of density join to the image's rim."""
    marks, _ = label(~np.pad(density > level, 1))
    return np.asarray(marks == marks[0, 0])[1:-1, 1:-1]


def area_above(values: NDArray[np.floating]) -> float:
    """Area, in pixels, over which an image (y, x) of pixel centres is positive, interpolated between them.

    Each square between four pixel centres is four triangles around its own centre, over which values are
    linear. Counting pixels would err by half a row along a straight wall.
    """
    padded = np.pad(values.astype(np.float64), 1, mode="edge")
    corners = np.stack([padded[:-1, :-1], padded[:-1, 1:], padded[1:, 1:], padded[1:, :-1]])
    positive = (corners > 0).sum(axis=0)
    share = (positive == 4).astype(np.float64)
    mixed = (positive > 0) & (positive < 4)
    around, centre = corners[:, mixed], corners[:, mixed].mean(axis=0)
    share[mixed] = np.mean([_positive_part(around[i], around[i - 1], centre) for i in range(4)], axis=0)
    share[[0, -1]] /= 2  # half of these squares lies outside of the image
    share[:, [0, -1]] /= 2
    return float(share.sum())


def _positive_part(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Share (n,) of triangles over which what is linear between values at the corners is positive."""
    low, middle, high = np.sort(np.stack([a, b, c]), axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        one = high**2 / ((high - middle) * (high - low))
        two = 1 - low**2 / ((middle - low) * (high - low))
    return np.select([low > 0, middle > 0, high > 0], [np.ones_like(low), two, one], 0.0)


def _length(above: NDArray[np.floating], lines: Sequence[shapely.LineString]) -> float:
    """Length of sections, l0, where an image (y, x) is positive.

    The ends are found by linear interpolation between samples.
    """
    return sum(_length_on(above, line) for line in lines)


def _ratio(length: float, before: float) -> float:
    return length / before if min(length, before) > 0 else float("nan")


def _length_on(above: NDArray[np.floating], section: shapely.LineString) -> float:
    pixels = above.shape[-1]
    step = pixel_size(pixels) / SAMPLES_PER_PIXEL
    # The centre is a sample, so that a mould and its mirror image are sampled alike.
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
    """A/A0 and w/w0, (2,), over the mould, as the paper words them: tethers are no tissue, in neither.

    w/w0 is NaN where the central section holds no depression.
    """
    above = density - (cast.threshold if threshold is None else threshold)
    width = _length(above, [cast.central_section])
    area = np.count_nonzero(above > 0) / np.count_nonzero(cast.depression)
    return np.array([area, width / _depression_width(cast.mould)])


def outline_ratios(tissue: shapely.Geometry, mould: Mould) -> tuple[float, float]:
    """A/A0 and w/w0 of a tissue given by its outline, l0, over the mould as drawn; w/w0 may be NaN.

    As measured on a photograph: a real gel fills its mould, which the lattice does only to within half a
    spacing. Thin tethers count as tissue where tissue encloses them, as in `shape_ratios`.
    """
    seen, gel = with_thin_tethers(tissue, mould), with_thin_tethers(mould.depression, mould)
    widths = [float(central_section(mould).intersection(shape).length) for shape in (seen, gel)]
    return float(seen.area / gel.area), _ratio(*widths)


def with_thin_tethers(tissue: shapely.Geometry, mould: Mould) -> shapely.Geometry:
    """The tissue's outline and the thin tethers that it encloses, with gaps between, as in `filled`."""
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
