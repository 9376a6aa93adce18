"""The tissue in a registered picture: its outline, its area and its width."""

from dataclasses import dataclass
from enum import StrEnum
from functools import partial, reduce

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter
from skimage.filters import threshold_multiotsu, threshold_otsu
from skimage.measure import find_contours

from raptor.core.errors import RaptorError
from raptor.fields.shape import outline_ratios
from raptor.imaging.illumination import IGNORED, find_plate, fit_light, log_brightness
from raptor.imaging.pictures import Picture
from raptor.imaging.registration import Registration
from raptor.moulds import Mould

MARGIN = 0.25, 4.0  # l0 and pixels along rim and tethers that are not read, because of shadow and blur
SMOOTHING = 0.12  # l0, Gaussian, at least one pixel
SPECK = 0.005  # of the depression's area: smaller pieces and holes are noise
RIM_SHADOW = 0.5  # l0 outside the rim that does not count as plate
GRAIN = 0.01  # l0^2; smaller rings of a contour are ignored
ROUNDS = 6  # of splitting the surfaces and fitting the illumination
DEGREE = 4  # of the illumination's polynomial, where surfaces are known everywhere
MIN_CONTRAST = (
    4.0  # standard deviations; the halves of Gaussian noise differ by 2.7, of a uniform spread by 3.5
)
BETWEEN = 0.15  # of the pixels; more than edges have, whose brightness lies between two surfaces
RIM_BAND = 1.5  # l0 along the rim, where a contracting tissue leaves the floor bare
MAX_OUTSIDE = 0.05  # share of a mask's tissue
PLATE, FIRST, SECOND = 0, 1, 2  # labels of surfaces; which of the last two is tissue is decided later


class Appearance(StrEnum):
    """Brightness of the tissue compared with the floor of the depression."""

    BRIGHT = "bright"
    DARK = "dark"
    AUTO = "auto"


def appearance_named(name: str) -> Appearance:
    """The appearance of a name; raises a RaptorError unless it is bright, dark or auto."""
    try:
        return Appearance(name)
    except ValueError:
        raise RaptorError(f"tissue is {name}; allowed are bright, dark and auto") from None


@dataclass(frozen=True)
class Measurement:
    """A measured tissue and how it was found.

    Parameters
    ----------
    outline : shapely.Geometry
        The tissue, a Polygon or MultiPolygon, l0.
    area_ratio, width_ratio : float
        A/A0 and w/w0; w/w0 is NaN if the central section misses the depression.
    threshold : float
        Brightness between tissue and floor, over that of the plate, illumination removed; 0.5 for a
        mask.
    tissue : Appearance
        Bright or dark.
    contrast : float
        Difference of tissue and floor, in standard deviations within them; NaN for a mask.
    brightness : array (row, column)
        The values compared with the threshold.
    read : array (row, column)
        The pixels of the depression from which the threshold was chosen.
    registration : Registration
    """

    outline: shapely.Geometry
    area_ratio: float
    width_ratio: float
    threshold: float
    tissue: Appearance
    contrast: float
    brightness: NDArray[np.float64]
    read: NDArray[np.bool_]
    registration: Registration


def measure(
    picture: Picture,
    mould: Mould,
    registration: Registration,
    tissue: Appearance = Appearance.AUTO,
    threshold: float | None = None,
) -> Measurement:
    """Outline, area and width of the tissue in a picture registered to its mould.

    The default threshold is Otsu's (1979), over the depression's pixels.

    Raises
    ------
    RaptorError
        If the depression lies outside the picture, no tissue is found, tissue and floor cannot be told
        apart, no pixel lies on one side of the threshold, or a mask leaves the depression.
    """
    size = picture.values.shape
    margin = max(MARGIN[0], MARGIN[1] / registration.scale)
    inside = registration.covers(mould.outline.buffer(-margin), size)
    for tether in mould.tethers:
        inside &= ~registration.covers(tether.polygon.buffer(margin), size)
    _require_in_picture(mould, registration, size, inside)
    if picture.mask:
        tissue = Appearance.BRIGHT if tissue is Appearance.AUTO else tissue
        if threshold is not None:
            raise RaptorError("the image is a two-valued mask; drop --threshold")
        brightness, level, contrast = picture.values, 0.5, float("nan")
    else:
        corrected = even_brightness(picture.values, mould, registration, inside)
        sigma = max(1.0, SMOOTHING * registration.scale)
        brightness = _smooth_within(corrected, inside, sigma)
        level, contrast = _threshold(brightness[inside], threshold)
        if tissue is Appearance.AUTO:
            band = inside & ~registration.covers(mould.outline.buffer(-margin - RIM_BAND), size)
            tissue = _look(brightness > level, inside, band)
    outline = _outline(brightness, level, tissue, registration)
    if picture.mask:
        _require_inside(outline, mould)
    # A piece that only a tether separates from the rest is no speck.
    joined = shapely.union_all([outline.intersection(mould.outline), *(t.polygon for t in mould.tethers)])
    joined = without_specks(joined, SPECK * mould.depression.area)
    parts = shapely.get_parts(joined.intersection(mould.depression))
    outline = shapely.union_all(parts[shapely.area(parts) > 0])  # where two tethers touch, a line is left
    if outline.area < SPECK * mould.depression.area:
        raise RaptorError(
            f"no tissue found at threshold {level:.3g} ({tissue.value} tissue); "
            "check --threshold and --tissue"
        )
    area, width = outline_ratios(outline, mould)
    return Measurement(outline, area, width, level, tissue, contrast, brightness, inside, registration)


def even_brightness(
    values: NDArray[np.float64], mould: Mould, registration: Registration, inside: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Brightness (row, column) over that of the plate, uneven illumination removed.

    The readable part of the depression, `inside` (row, column), is split into two surfaces, which are
    fitted with the plate and the illumination, in alternation.
    """
    log = log_brightness(values, max(1.0, SMOOTHING * registration.scale))
    plate, flat, _ = find_plate(log)
    plate &= ~registration.covers(mould.outline.buffer(RIM_SHADOW), log.shape)
    labels = np.where(plate, PLATE, IGNORED).astype(np.int8)
    for _ in range(ROUNDS):
        split = threshold_otsu(flat[inside])
        labels[inside] = np.where(flat[inside] > split, SECOND, FIRST)
        light, levels = fit_light(log, labels, DEGREE)
        flat = log - light - levels[PLATE]
    return np.asarray(values * np.exp(-light - levels[PLATE]))


def without_specks(shape: shapely.Geometry, least: float) -> shapely.Geometry:
    """The shape without pieces and holes smaller than `least`, l0^2."""
    pieces = [piece for piece in shapely.get_parts(shape) if piece.area >= least]
    return shapely.union_all(
        [
            shapely.Polygon(piece.exterior, [r for r in piece.interiors if shapely.Polygon(r).area >= least])
            for piece in pieces
        ]
    )


def _smooth_within(
    values: NDArray[np.float64], inside: NDArray[np.bool_], sigma: float
) -> NDArray[np.float64]:
    """Gaussian average over the pixels inside (normalised convolution: Knutsson and Westin 1993).

    Pixels beyond rim and tethers do not contribute; there the nearest average is extended.
    """
    blur = partial(gaussian_filter, sigma=sigma, mode="constant", truncate=4.0)
    weight = blur(inside.astype(float))
    known = weight > 1e-3
    smooth = blur(np.where(inside, values, 0.0)) / np.where(known, weight, 1.0)
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(smooth[tuple(nearest)])


def _threshold(seen: NDArray[np.float64], given: float | None) -> tuple[float, float]:
    """The threshold, and the contrast between its two sides."""
    level = float(threshold_otsu(seen)) if given is None else given
    above = seen > level
    if above.all() or not above.any():
        raise RaptorError(
            f"threshold is {level:.3g}; brightness in the depression runs from {seen.min():.3g} to "
            f"{seen.max():.3g} of the plate's; choose a value between"
        )
    contrast = _contrast(seen[~above], seen[above])
    if given is None and contrast < MIN_CONTRAST:
        raise RaptorError(
            f"tissue and floor cannot be told apart: their contrast is {contrast:.1f} standard deviations "
            f"({MIN_CONTRAST} are needed); improve the lighting, give a mask, or set --threshold"
        )
    if given is None:
        _require_two_surfaces(seen)
    return level, contrast


def _contrast(dark: NDArray[np.float64], bright: NDArray[np.float64]) -> float:
    """Difference of the means of two sets of pixels, over the standard deviation within them."""
    within = (dark.size * dark.var() + bright.size * bright.var()) / (dark.size + bright.size)
    return float((bright.mean() - dark.mean()) / np.sqrt(within))


def _require_two_surfaces(seen: NDArray[np.float64]) -> None:
    """Refuse a third surface, as a lamp's reflection is, which may be taken for the tissue."""
    low, high = threshold_multiotsu(seen, 3)
    parts = [seen[seen <= low], seen[(seen > low) & (seen <= high)], seen[seen > high]]
    least = min(_contrast(parts[0], parts[1]), _contrast(parts[1], parts[2]))
    if least > MIN_CONTRAST and parts[1].size > BETWEEN * seen.size:
        levels = ", ".join(f"{part.mean():.2g} ({100 * part.size / seen.size:.0f} %)" for part in parts)
        raise RaptorError(
            f"the depression shows three surfaces, of {levels} of the plate's brightness; if one is a lamp's "
            "reflection, turn the lamp; give a mask, or say by --threshold what is tissue"
        )


def _look(above: NDArray[np.bool_], inside: NDArray[np.bool_], band: NDArray[np.bool_]) -> Appearance:
    """Bright or dark: the floor is the surface more frequent along the rim than elsewhere."""
    along, elsewhere = float(above[band].mean()), float(above[inside & ~band].mean())
    if abs(along - elsewhere) < 0.1 * max(along, elsewhere):
        raise RaptorError("cannot tell which surface is the tissue; give --tissue bright or --tissue dark")
    return Appearance.DARK if along > elsewhere else Appearance.BRIGHT


def _outline(
    brightness: NDArray[np.float64], level: float, tissue: Appearance, registration: Registration
) -> shapely.Geometry:
    """The region on the tissue's side of a level, as polygons in l0 with sub-pixel precision."""
    signed = (brightness - level) * (1 if tissue is Appearance.BRIGHT else -1)
    signed = np.pad(signed, 1, constant_values=-float(np.abs(signed).max()))
    rings = [registration.to_mould(ring[:, ::-1] - 1) for ring in find_contours(signed, 0.0) if len(ring) > 3]
    shapes = [shape for ring in rings if (shape := shapely.Polygon(ring).buffer(0)).area > GRAIN]
    # Contours do not cross: a ring inside a ring is a hole, and a ring inside a hole is a piece.
    return reduce(shapely.symmetric_difference, shapes, shapely.Polygon())


def _require_in_picture(
    mould: Mould, registration: Registration, size: tuple[int, ...], inside: NDArray[np.bool_]
) -> None:
    corners = registration.to_pixels(shapely.get_coordinates(mould.outline))
    rows, columns = size
    reach = float(max((-corners).max(), (corners - (columns - 1, rows - 1)).max()))
    if reach > 1 or np.count_nonzero(inside) < 100:
        raise RaptorError(
            f"{mould.name} does not lie in the image as registered, or covers too few pixels; "
            "show all of it, larger, or check the landmarks"
        )


def _require_inside(outline: shapely.Geometry, mould: Mould) -> None:
    outside = outline.difference(mould.outline).area / max(outline.area, 1e-9)
    if outside > MAX_OUTSIDE:
        raise RaptorError(
            f"{100 * outside:.0f} % of the mask lies outside the depression of {mould.name} (at most "
            f"{100 * MAX_OUTSIDE:.0f} % may); check the registration and --tissue"
        )
