"""Area and width of a tissue (paper, "Model parameters and predictive capability").

From its density, as simulated or predicted, or from its outline, as measured.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from raptor.frame import IMAGE_SIZE, pixel_size
from raptor.moulds.geometry import Mould
from raptor.moulds.raster import MouldImage, mould_image

SAMPLES_PER_PIXEL = 4  # along a section


def density_threshold(layers: int, pixels: int) -> float:
    """Density per pixel above which there is tissue: 0.2 at 7 layers and 256 pixels (paper)."""
    return 0.48 * layers * pixel_size(pixels) ** 2


def area_ratio(density: NDArray[np.floating], image: MouldImage, threshold: float) -> float:
    """A/A0: pixels (y, x) of tissue anywhere in the image, over pixels of the depression."""
    return float(np.count_nonzero(density > threshold) / np.count_nonzero(image.depression))


def ratios_above(
    density: NDArray[np.floating], image: MouldImage, mould: Mould, threshold: float
) -> NDArray[np.float64]:
    """A/A0 and w/w0, (2,), of the tissue where density (y, x) is above a threshold."""
    return np.array([area_ratio(density, image, threshold), width_ratio(density, mould, threshold)])


def shape_ratios(density: NDArray[np.floating], mould: Mould, layers: int) -> tuple[float, float]:
    """A/A0 and w/w0 of a tissue of so many layers from its density (y, x) in its mould.

    Raises
    ------
    RaptorError
        Where the depression covers no pixel.
    """
    pixels = density.shape[-1]
    area, width = ratios_above(density, mould_image(mould, pixels), mould, density_threshold(layers, pixels))
    return float(area), float(width)


def central_section(mould: Mould) -> shapely.LineString:
    """The line across the centre of the depression's minimum rotated rectangle, along its short side.

    Where the two sides are equal, the one nearer to x counts as the long one.
    """
    return sections(mould, (0.0,))[0]


def sections(mould: Mould, places: Sequence[float]) -> list[shapely.LineString]:
    """Lines parallel to the central section, at places from -1 to 1 along half of the long side."""
    centre, half = long_axis(mould)
    across = np.array([-half[1], half[0]]) / np.hypot(*half)
    reach = IMAGE_SIZE * across
    middles = [centre + place * half for place in places]
    return [shapely.LineString([middle - reach, middle + reach]) for middle in middles]


def long_axis(mould: Mould) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centre of the depression's minimum rotated rectangle, and half of its long side, each (2,), l0."""
    rectangle = shapely.oriented_envelope(mould.outline)
    corners = shapely.get_coordinates(rectangle)[:4]
    sides = corners[1:3] - corners[:2]
    lengths = np.linalg.norm(sides, axis=1)
    if np.isclose(lengths[0], lengths[1], rtol=1e-6):
        long = int(np.abs(sides[1, 0]) > np.abs(sides[0, 0]))
    else:
        long = int(lengths[1] > lengths[0])
    return corners.mean(axis=0), sides[long] / 2


def width_ratio(density: NDArray[np.floating], mould: Mould, threshold: float) -> float:
    """w/w0: length of tissue on the central section over length of depression; NaN without any."""
    return section_ratio(density, mould, threshold, [central_section(mould)])


def section_ratio(
    density: NDArray[np.floating], mould: Mould, threshold: float, lines: Sequence[shapely.LineString]
) -> float:
    """Length of tissue on sections through the image over length of depression; NaN without any.

    The ends of the tissue are found by linear interpolation of the density (y, x) between samples.
    """
    return sum(_tissue_length(density, line, threshold) for line in lines) / _cast_width(lines, mould)


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
