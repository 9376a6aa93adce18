"""Area and width of a tissue (paper, "Model parameters and predictive capability").

From its density, as simulated or predicted, or from its outline, as measured.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from raptor.frame import pixel_size
from raptor.moulds.cast import CastMould, central_section
from raptor.moulds.geometry import Mould

SAMPLES_PER_PIXEL = 4  # along a section


def shape_ratios(
    density: NDArray[np.floating], cast: CastMould, threshold: float | None = None
) -> NDArray[np.float64]:
    """A/A0 and w/w0, (2,), of a tissue from its density (y, x) in its mould.

    Parameters
    ----------
    threshold : float or None
        Density per pixel above which there is tissue; None for `cast.threshold`.
    """
    return np.array([area_ratio(density, cast, threshold), width_ratio(density, cast, threshold)])


def area_ratio(density: NDArray[np.floating], cast: CastMould, threshold: float | None = None) -> float:
    """A/A0: pixels (y, x) of tissue anywhere in the image, over pixels of the depression."""
    threshold = cast.threshold if threshold is None else threshold
    return float(np.count_nonzero(density > threshold) / np.count_nonzero(cast.depression))


def width_ratio(density: NDArray[np.floating], cast: CastMould, threshold: float | None = None) -> float:
    """w/w0: length of tissue on the central section over length of depression; NaN without any."""
    return section_ratio(density, cast, [cast.central_section], threshold)


def section_ratio(
    density: NDArray[np.floating],
    cast: CastMould,
    lines: Sequence[shapely.LineString],
    threshold: float | None = None,
) -> float:
    """Length of tissue on sections through the image over length of depression; NaN without any.

    The ends of the tissue are found by linear interpolation of the density (y, x) between samples.
    """
    threshold = cast.threshold if threshold is None else threshold
    length = sum(_tissue_length(density, line, threshold) for line in lines)
    return length / _cast_width(lines, cast.mould)


def _tissue_length(density: NDArray[np.floating], section: shapely.LineString, threshold: float) -> float:
    """Length of tissue on a section, l0."""
    pixels = density.shape[-1]
    step = pixel_size(pixels) / SAMPLES_PER_PIXEL
    # The centre is a sample, so that a mould and its mirror image are sampled alike.
    count = int(section.length / 2 / step)
    along = np.arange(-count, count + 1) * step
    (x0, y0), (x1, y1) = section.coords
    x = (x0 + x1) / 2 + along * (x1 - x0) / section.length
    y = (y0 + y1) / 2 + along * (y1 - y0) / section.length
    middle = (pixels - 1) / 2
    rows, columns = (middle + c / pixel_size(pixels) for c in (y, x))
    values = map_coordinates(density, [rows, columns], order=1, mode="constant", cval=0.0)
    return _length_above(values - threshold) * step


def outline_ratios(tissue: shapely.Geometry, mould: Mould) -> tuple[float, float]:
    """A/A0 and w/w0 of a tissue given by its outline, l0; w/w0 is NaN where `width_ratio` is."""
    section = central_section(mould)
    width = float(section.intersection(tissue).length)
    return float(tissue.area / mould.depression.area), width / _cast_width([section], mould)


def _cast_width(lines: Sequence[shapely.LineString], mould: Mould) -> float:
    """Length of depression on sections, l0; NaN without any."""
    length = sum(float(line.intersection(mould.depression).length) for line in lines)
    return length if length >= 1e-9 else float("nan")


def _length_above(excess: NDArray[np.floating]) -> float:
    """Length, in samples, over which a piecewise linear function is positive."""
    left, right = excess[:-1], excess[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.maximum(left, right) / np.abs(left - right)
    lengths = np.where((left > 0) & (right > 0), 1.0, np.where((left > 0) | (right > 0), share, 0.0))
    return float(lengths.sum())
