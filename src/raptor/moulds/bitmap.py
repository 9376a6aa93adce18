"""Moulds painted as pictures: white is outside, black or grey the depression, red a tether (docs/moulds.md).

Walls run where a pixel would be half of one colour and half of the other, so soft (anti-aliased) edges give
sub-pixel precision. White spots within the depression are tethers too.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from skimage.measure import find_contours

from raptor.core.errors import RaptorError
from raptor.core.pixels import read_pixels
from raptor.moulds.drawing import Drawing
from raptor.moulds.geometry import Circle
from raptor.moulds.shapes import Page, Shape

WHITE = 0.9  # lightness, out of 1, from which a pixel is outside
TINT = 0.3  # largest difference of green and blue, or excess over red, out of 1
RED = 0.25  # least excess of red over green and blue in a tether, out of 1
SHADE = 0.2  # largest difference of greys within the depression, out of 1
TOLERANCE = 0.5  # pixels; largest distance of a simplified wall from the contour
BLUR = 1.0  # pixels; precision to which drawing programs place a wall
MOST_PIXELS = 4096  # per side


def read_bitmap(path: Path, page: int | None = None) -> Drawing:
    """Read a picture (PNG, TIFF, JPEG, ...) that shows one mould; pages count from 1.

    Raises
    ------
    RaptorError
        If the file is no picture, or shows no depression or several.
    """
    path = Path(path)
    where = f"mould file {path}"
    colours = read_pixels(path, "mould file", page).on_white
    rows, columns = colours.shape[:2]
    if max(rows, columns) > MOST_PIXELS:
        raise RaptorError(
            f"{where} is {columns} x {rows} pixels large; reduce it to at most {MOST_PIXELS} per side "
            "(1,000 are enough)"
        )
    sheet, walls = Page(-0.5, 0.5 - rows, columns, rows), tuple(_walls(colours, where))
    # A square picture is the frame, as for photographs aligned with the mould.
    return Drawing(walls, (), sheet, "pixel", framed=rows == columns, blur=BLUR)


def _walls(colours: NDArray[np.float64], where: str) -> Iterator[Shape]:
    """Outline and tethers of a picture (row, column, 3), in pixels, y up; tethers with their positions."""
    _require_known(colours, where)
    light, redness = colours.min(axis=2), colours[..., 0] - colours[..., 1:].max(axis=2)
    grey = light[(light < WHITE) & (redness < RED)]
    if grey.size == 0:
        raise RaptorError(
            f"{where} shows no depression; paint it black or grey on white, and the tethers in it red"
        )
    rim = np.concatenate([light[0], light[-1], light[:, 0], light[:, -1]])
    if (rim < WHITE).all():
        raise RaptorError(
            f"{where} is dark all along its border; outside is white and the depression dark, so invert the "
            "colours, or leave a white border"
        )
    reds = redness[redness >= RED]
    red = _regions(redness - np.median(reds) / 2) if reds.size else []
    painted = shapely.union_all(red).buffer(1)
    bodies = [part for part in _regions((1 + np.median(grey)) / 2 - light) if not painted.covers(part)]
    if len(bodies) != 1:
        places = " and ".join(_place(part) for part in sorted(bodies, key=lambda part: -part.area)[:3])
        raise RaptorError(
            f"{where} shows {len(bodies)} dark pieces ({places}); a mould is one connected depression on "
            "white, so join the pieces, or paint stray ones white"
        )
    _require_one_grey(light, float(np.median(grey)), bodies[0].difference(painted), where)
    outline = shapely.Polygon(bodies[0].exterior).simplify(TOLERANCE)
    holes = [shapely.Polygon(ring) for ring in bodies[0].interiors]
    yield Shape("of the depression", outline, "outline")
    for part in [*red, *holes]:
        yield Shape(f"at {_place(part)}", _tether(part, outline), "tether")


def _require_known(colours: NDArray[np.float64], where: str) -> None:
    """Raise a RaptorError naming a pixel whose colour is not white, grey, red or a mixture of these."""
    red, green, blue = np.moveaxis(colours, 2, 0)
    strange = (np.abs(green - blue) > TINT) | (np.maximum(green, blue) - red > TINT)
    if strange.any():
        row, column = (int(place) for place in np.argwhere(strange)[0])
        colour = "#" + "".join(f"{round(255 * value):02x}" for value in colours[row, column])
        raise RaptorError(
            f"{where} has the colour {colour} at column {column}, row {row}; allowed are white (outside), "
            "black or grey (depression) and red (tether)"
        )


def _require_one_grey(light: NDArray[np.float64], grey: float, body: shapely.Polygon, where: str) -> None:
    """Raise a RaptorError naming a spot of another grey in the depression: a tether that lost its red."""
    for spot in _regions(np.abs(light - grey) - SHADE):
        inside = spot.intersection(body.buffer(-2)).buffer(-2)
        if not inside.is_empty:
            raise RaptorError(
                f"{where} has a spot of another grey within the depression, at {_place(inside)}; paint "
                "tethers red or white, and the depression in one grey"
            )


def _regions(field: NDArray[np.float64]) -> list[shapely.Polygon]:
    """Where a field (row, column) is positive: polygons, holes included, in pixels, y up."""
    padded = np.pad(field, 1, constant_values=min(-1e-3, float(field.min())))
    lines = [shapely.LineString(line[:, ::-1] * (1, -1) - (1, -1)) for line in find_contours(padded, 0.0)]
    return list(shapely.get_parts(shapely.build_area(shapely.MultiLineString(lines))))


def _tether(part: shapely.Polygon, outline: shapely.Polygon) -> shapely.Polygon:
    """The wall of a painted region: a circle if it is round to half a pixel."""
    centre, radius = part.centroid, float(np.sqrt(part.area / np.pi))
    corners = shapely.get_coordinates(part)
    post = Circle(centre.x, centre.y, radius)
    reach = np.hypot(corners[:, 0] - centre.x, corners[:, 1] - centre.y)
    if np.abs(reach - radius).max() < TOLERANCE and post.stands_in(outline):
        return post.polygon
    simple = part.simplify(TOLERANCE)
    inside = simple.intersection(outline)  # simplification must not push a tether out through the wall
    return inside if inside.geom_type == "Polygon" and not inside.is_empty else simple


def _place(part: shapely.Polygon) -> str:
    """A region's position, for messages."""
    point = part.representative_point()
    return f"column {point.x:.0f}, row {-point.y:.0f}"
