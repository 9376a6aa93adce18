"""Fits to the whole outline of a tissue, which may determine what two ratios leave open.

The outline is the contour of the density at the threshold of tissue. Residuals are signed distances from
evenly spaced points of the measured outline to the predicted one, positive if the prediction is too large;
both have sub-pixel precision (marching squares).
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from skimage.filters import threshold_otsu
from skimage.measure import find_contours

from raptor.core.errors import RaptorError
from raptor.core.files import read_json
from raptor.core.pixels import read_pixels
from raptor.fitting.least_squares import Minimum
from raptor.fitting.targets import Measure, as_array, parameters_at
from raptor.frame import IMAGE_SIZE, pixel_size
from raptor.moulds.bitmap import MOST_PIXELS
from raptor.parameters import CellParameters

POINTS = 128  # along the measured outline
OUTLINE_ERROR = 0.25  # l0; of an outline drawn on a photograph: a pixel of the paper's image
SPECK = 0.01  # of the tissue's area; smaller pieces of an image are ignored
APART = 4.0  # l0; correlation length of errors along an outline
STEP = 0.02  # of finite differences

Densities = Callable[[Sequence[CellParameters]], Any]
"""From n sets of parameters to densities (n, y, x)."""


@dataclass(frozen=True)
class Outline:
    """The outline of a tissue.

    Parameters
    ----------
    points : ndarray (n, 2)
        Evenly spaced, x and y, l0.
    length : float
        Of the outline, l0.
    """

    points: NDArray[np.float64]
    length: float

    @classmethod
    def along(cls, tissue: shapely.Geometry, count: int = POINTS) -> "Outline":
        """Points evenly spaced along the outer boundaries of a tissue."""
        rings = [shapely.Polygon(part.exterior).exterior for part in shapely.get_parts(tissue)]
        length = sum(ring.length for ring in rings)
        places = [np.arange(0, ring.length, length / count) for ring in rings]
        points = [
            shapely.line_interpolate_point(ring, each) for ring, each in zip(rings, places, strict=True)
        ]
        return cls(shapely.get_coordinates(np.concatenate(points)), float(length))


def read_outline(path: Path, page: int | None = None) -> Outline:
    """Read the outline of a tissue: GeoJSON as `raptor measure` writes it, or a picture of the frame.

    A picture (PNG, JPEG, TIFF) shows the image of 62.5 l0: crop it to the frame first, square, with the
    mould's centre in the middle. The tissue is what differs from the picture's border; its edge is half-way
    between both colours (Otsu).

    Raises
    ------
    RaptorError
        If the file cannot be read, is no polygon, or the picture is not square or shows no tissue.
    """
    if Path(path).suffix.lower() in (".geojson", ".json"):
        return _drawn(Path(path))
    grey = _grey(Path(path), page)
    rim = np.concatenate([grey[0], grey[-1], grey[:, 0], grey[:, -1]])
    if grey.min() == grey.max():
        raise RaptorError(f"outline {path} has one colour; paint the tissue dark on white")
    dark = grey <= threshold_otsu(grey)
    level = float(np.median(grey[dark]) + np.median(grey[~dark])) / 2  # half-way, where edges are soft
    excess = level - grey if np.median(rim) > level else grey - level
    return Outline.along(
        tissue_above(excess[::-1], f"outline {path}")
    )  # the first row of a picture is on top


def _drawn(path: Path) -> Outline:
    """The outline in a GeoJSON file of one feature, l0."""
    content = read_json(path)
    try:
        if len(content.get("features", ())) == 1:
            (content,) = content["features"]
        if "tethers" in (content.get("properties") or {}):
            raise RaptorError(f"outline {path} is a mould; give the tissue's, from raptor measure --outline")
        tissue = shapely.from_geojson(json.dumps(content.get("geometry", content)))
    except (shapely.GEOSException, AttributeError, TypeError) as error:
        raise RaptorError(f"outline {path} is not GeoJSON of one tissue: {error}") from error
    return drawn_outline(tissue, f"outline {path}")


def drawn_outline(tissue: shapely.Geometry | None, what: str = "the outline") -> Outline:
    """The outline of a tissue drawn as a polygon or several, l0.

    Raises
    ------
    RaptorError
        If it is none, or leaves the frame.
    """
    if tissue is None or tissue.geom_type not in ("Polygon", "MultiPolygon") or tissue.is_empty:
        raise RaptorError(f"{what} holds no polygon; give what raptor measure --outline writes")
    if np.abs(tissue.bounds).max() > IMAGE_SIZE / 2:
        raise RaptorError(f"{what} leaves the frame of {IMAGE_SIZE} l0; its lengths must be in l0")
    return Outline.along(tissue)


def outline_of(density: NDArray[np.floating], threshold: float) -> Outline:
    """The outline of a tissue from its density (y, x).

    Raises
    ------
    RaptorError
        If the density is nowhere above the threshold.
    """
    return Outline.along(tissue_above(density - threshold, "the density"))


def distances(outline: Outline, density: NDArray[np.floating], threshold: float) -> NDArray[np.float64]:
    """Signed distances (n,) of an outline's points to the edge of a density (y, x), positive inside it, l0.

    NaN if the density is nowhere above the threshold.
    """
    try:
        tissue = tissue_above(density - threshold, "the density")
    except RaptorError:
        return np.full(len(outline.points), np.nan)
    edge = shapely.union_all([shapely.Polygon(part.exterior) for part in shapely.get_parts(tissue)])
    points = shapely.points(outline.points)
    shapely.prepare(edge)
    apart = np.asarray(shapely.distance(points, edge.boundary), dtype=np.float64)
    inside = np.asarray(shapely.contains(edge, points), dtype=bool)
    return np.where(inside, apart, -apart)


def outline_measure(densities: Densities, outline: Outline, threshold: float) -> Measure:
    """Signed distances (n, points) of an outline to a model's, over the root of their number.

    The residual sum of squares is then the mean square distance, l0^2.
    """

    def measure(parameters: Sequence[CellParameters]) -> NDArray[np.float64]:
        found = [distances(outline, density, threshold) for density in densities(parameters)]
        return np.asarray(np.array(found) / np.sqrt(len(outline.points)))

    return measure


def deviations(
    measure: Measure, minimum: Minimum, outline: Outline, error: float, step: float = STEP
) -> NDArray[np.float64]:
    """Standard errors (3,) of the parameters of a fit to an outline, from the derivatives at the minimum.

    Each length `APART` of the outline counts as one measurement, with the larger of `error` (l0) and the root
    mean square residual distance. Infinite if the outline leaves a combination open.
    """
    steps = np.where(minimum.unit + step <= 1, step, -step)
    moved = [parameters_at(unit) for unit in (minimum.unit, *(minimum.unit + np.diag(steps)))]
    here, *there = measure(moved)
    change = as_array(moved)[1:] - as_array(moved)[0]
    slope_of_cube = np.stack([(each - here) for each in there], axis=1)
    slope = slope_of_cube @ np.linalg.inv(change).T
    independent = max(outline.length / APART, 1.0)
    variance = max(error**2, minimum.rss)
    information = independent * slope.T @ slope / variance
    if np.linalg.matrix_rank(information, tol=1e-9 * float(np.trace(information))) < 3:
        return np.full(3, np.inf)
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(information))))


def _grey(path: Path, page: int | None) -> NDArray[np.float64]:
    """Lightness (row, column) of a square picture, 0 to 1."""
    colours = read_pixels(path, "outline", page).on_white
    rows, columns = colours.shape[:2]
    if rows != columns or columns > MOST_PIXELS:
        raise RaptorError(
            f"outline {path} is {columns} x {rows} pixels; crop it to the square frame of {IMAGE_SIZE} "
            f"l0 about the mould's centre, at most {MOST_PIXELS} pixels per side"
        )
    return np.asarray(colours.mean(axis=2))


def tissue_above(excess: NDArray[np.floating], what: str) -> shapely.Geometry:
    """The region where a field (y, x) on the image's raster is positive, without specks, l0."""
    size = pixel_size(excess.shape[-1])
    padded = np.pad(excess, 1, constant_values=min(float(excess.min()), -1e-6))
    origin = -IMAGE_SIZE / 2 - size / 2
    lines = [shapely.LineString(line[:, ::-1] * size + origin) for line in find_contours(padded, 0.0)]
    found = shapely.get_parts(shapely.build_area(shapely.MultiLineString(lines)))
    if len(found) == 0:
        raise RaptorError(f"{what} shows no tissue; give one with tissue that differs from its border")
    areas = shapely.area(found)
    kept: shapely.Geometry = shapely.MultiPolygon(list(found[areas > SPECK * areas.sum()]))
    return kept
