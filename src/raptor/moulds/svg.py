"""Moulds drawn as SVG: closed shapes, distinguished by name or by size (docs/moulds.md).

A shape is a visible path, polygon, polyline, rectangle, circle or ellipse; strokes, fills, text, images and
straight lines are ignored. A path of several pieces is several shapes.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from io import BytesIO
from math import isclose, isfinite, nan
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import shapely
import svgelements

from raptor.core.errors import RaptorError
from raptor.core.files import read_input
from raptor.moulds.drawing import Drawing, Page
from raptor.moulds.geometry import CIRCLE_SEGMENTS, Circle, Mould, PolygonTether, Tether

OUTLINE = ("outline", "depression")
TETHER = ("tether", "post")
LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"
SMOOTH = 1e-4  # largest distance of a straightened curve from the drawn one, over the shape's longer side
SHAPES = {
    "path": svgelements.Path,
    "polygon": svgelements.Polygon,
    "polyline": svgelements.Polyline,
    "rect": svgelements.Rect,
    "circle": svgelements.Circle,
    "ellipse": svgelements.Ellipse,
}
DRAWN: Any = tuple(SHAPES.values())
LENGTHS = {"x", "y", "width", "height", "cx", "cy", "r", "rx", "ry"}
LENGTH = re.compile(r"\s*([+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*(px|pt|pc|mm|cm|in|%)?|auto)\s*")
PATH_DATA = re.compile(r"\s*([Mm][MmZzLlHhVvCcSsQqTtAaEe\d\s.,+-]*)?")


@dataclass(frozen=True)
class _Shape:
    """A closed piece of a drawing, in user units, y up; `role` is "outline", "tether" or ""."""

    name: str
    role: str
    polygon: shapely.Polygon
    circle: Circle | None = None

    @property
    def size(self) -> float:
        """Area of its convex hull, which a shape that crosses itself has too."""
        return float(self.polygon.convex_hull.area)

    @property
    def tether(self) -> Tether:
        """The shape as a tether; a drawn circle stays exactly round."""
        return self.circle or PolygonTether(self.polygon)


def read_svg(path: Path, scale: float | None = None) -> Mould:
    """Read an SVG file that holds one mould; `scale` is l0 per user unit.

    Raises
    ------
    RaptorError
        If the file is not SVG, draws no outline or several, or the mould cannot be cast.
    """
    path = Path(path)
    where = f"mould file {path}"
    content = read_input(path, "mould file", "an SVG drawing")
    root = _root(content, where)
    for element in root.iter():
        _require_readable(element, where)
    if scale is None and "data-l0" in root.attrib:
        scale = _unit(root.attrib["data-l0"], where)
    try:
        drawn = svgelements.SVG.parse(BytesIO(content), reify=False)
        if not isinstance(drawn, svgelements.SVG):
            raise ValueError('the root lacks the namespace xmlns="http://www.w3.org/2000/svg"')
        # svgelements gives CSS pixels; lengths here are the file's own, with y up.
        matrix = ~svgelements.Matrix(drawn.viewbox_transform or "") * svgelements.Matrix.scale(1, -1)
        shapes, page = list(_shapes(drawn, "", matrix)), _page(drawn, root)
    except (ValueError, TypeError, AttributeError, IndexError, ArithmeticError) as error:
        raise RaptorError(f"{where} cannot be read: {error}; save it again as plain SVG") from error
    outline, tethers = _told_apart(shapes, where)
    named = tuple((f"tether {shape.name}", shape.tether) for shape in tethers)
    return Drawing(outline.polygon, named, page, "user unit").mould(path, scale)


def _root(content: bytes, where: str) -> ElementTree.Element:
    """The root element of an SVG document."""
    try:
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise RaptorError(
            f"{where} is not SVG, or is truncated: {error}; save it again as plain SVG"
        ) from error
    if _tag(root) != "svg":
        raise RaptorError(f"{where} is not SVG: its root is <{_tag(root)}>; save it as plain SVG")
    return root


def _tag(element: ElementTree.Element) -> str:
    """An element's name without its namespace."""
    return str(element.tag).rsplit("}", 1)[-1]


def _require_readable(element: ElementTree.Element, where: str) -> None:
    """Raise a RaptorError for a shape that svgelements would silently drop or truncate."""
    tag, attributes = _tag(element), element.attrib
    if tag not in SHAPES:
        return
    try:
        if tag == "path":
            if not PATH_DATA.fullmatch(attributes.get("d", "")):
                raise ValueError("d must be path data")
            svgelements.Path(attributes.get("d", ""))
        elif tag in ("polygon", "polyline"):
            corners = attributes.get("points", "").replace(",", " ").split()
            if len([float(value) for value in corners]) % 2:
                raise ValueError("points must be pairs of numbers")
        for key in LENGTHS & set(attributes):
            if not LENGTH.fullmatch(attributes[key]):
                raise ValueError(f"{key} must be a length")
    except ValueError as error:
        reason = f" ({error})" if str(error) else ""
        raise RaptorError(
            f"{where}: <{tag}> '{attributes.get('id', 'without id')}' cannot be read{reason}; "
            "draw it again, or delete it"
        ) from error


def _unit(text: str, where: str) -> float:
    """The value of the attribute data-l0: l0 per user unit."""
    try:
        value = float(text)
    except ValueError:
        value = nan
    if not (isfinite(value) and value > 0):
        raise RaptorError(f"{where}: data-l0 is '{text}'; give a positive number, l0 per user unit")
    return value


def _page(drawn: svgelements.SVG, root: ElementTree.Element) -> Page | None:
    """The page: the viewBox, or else width and height if they are lengths."""
    box = drawn.viewbox
    if box is not None and None not in (box.x, box.y, box.width, box.height):
        x, y, width, height = box.x, box.y, box.width, box.height
    elif all(root.attrib.get(key, "%").strip()[-1:] not in ("%", "") for key in ("width", "height")):
        x, y, width, height = 0.0, 0.0, drawn.width, drawn.height
    else:
        return None
    if not min(width, height) > 0:
        return None
    return Page(x + width / 2, -(y + height / 2), max(width, height))


def _shapes(element: Any, role: str, matrix: svgelements.Matrix) -> Iterator[_Shape]:
    """Closed shapes of an element and its children, transformed; names pass from groups to shapes."""
    role = _role(element, role)
    if isinstance(element, (svgelements.Group, svgelements.Use)):
        for part in element:
            yield from _shapes(part, role, matrix)
    elif isinstance(element, DRAWN):
        pieces = sorted(_pieces(element, role, matrix), key=lambda p: p.size, reverse=True)
        for number, piece in enumerate(pieces):
            # The other pieces of a path called outline are tethers within its largest piece.
            yield replace(piece, role="tether") if number and role == "outline" else piece


def _role(element: Any, inherited: str) -> str:
    """The role named by an element's id, class or Inkscape label, or else by its group's."""
    values = element.values
    for word in (element.id or "", *(values.get("class") or "").split(), values.get(LABEL) or ""):
        for role, beginnings in (("outline", OUTLINE), ("tether", TETHER)):
            if word.lower().startswith(beginnings):
                return role
    return inherited


def _pieces(element: Any, role: str, matrix: svgelements.Matrix) -> Iterator[_Shape]:
    """The pieces of a shape that enclose an area."""
    path = abs(svgelements.Path(element) * matrix)
    for piece in path.as_subpaths():
        points = [point for segment in piece for point in _points(segment)]
        if len({(point.x, point.y) for point in points}) < 3:
            continue  # a straight line, or a point
        polygon = shapely.Polygon([(point.x, point.y) for point in points])
        if polygon.convex_hull.area == 0:
            continue
        if polygon.is_valid:
            x0, y0, x1, y1 = polygon.bounds
            polygon = polygon.simplify(SMOOTH * max(x1 - x0, y1 - y0))
        yield _Shape(_name(element, polygon), role, polygon, _circle(element, piece))


def _name(element: Any, polygon: shapely.Polygon) -> str:
    """A shape's name in messages: its id, or its kind and position in the drawing."""
    if element.id:
        return f"'{element.id}'"
    x, y = polygon.centroid.x, polygon.centroid.y
    return f"<{element.values.get('tag', 'shape')}> at ({x:.4g}, {-y:.4g})"


def _points(segment: Any) -> list[Any]:
    """Points along a segment of a path, without its start."""
    if isinstance(segment, (svgelements.CubicBezier, svgelements.QuadraticBezier, svgelements.Arc)):
        return [segment.point(t) for t in np.linspace(0, 1, CIRCLE_SEGMENTS + 1)[1:]]
    return [] if segment.end is None else [segment.end]


def _circle(element: Any, piece: Any) -> Circle | None:
    """The circle that a piece draws, if any."""
    if not isinstance(element, (svgelements.Circle, svgelements.Ellipse)):
        return None
    arc = next(segment for segment in piece if isinstance(segment, svgelements.Arc))
    if not isclose(arc.rx, arc.ry, rel_tol=1e-6):
        return None
    return Circle(float(arc.center.x), float(arc.center.y), float(arc.rx))


def _told_apart(shapes: list[_Shape], where: str) -> tuple[_Shape, list[_Shape]]:
    """The outline, and all other shapes as tethers."""
    outlines = [shape for shape in shapes if shape.role == "outline"]
    if len(outlines) > 1:
        names = ", ".join(shape.name for shape in outlines)
        raise RaptorError(
            f"{where}: {len(outlines)} shapes are called outline ({names}); a mould is one connected "
            "outline, so keep one and name the shapes in it tether"
        )
    candidates = outlines or [shape for shape in shapes if shape.role != "tether"]
    if not candidates:
        raise RaptorError(
            f"{where} draws no outline; draw the depression as a closed path, polygon, rectangle, circle "
            "or ellipse with the id 'outline'"
        )
    outline = max(candidates, key=lambda shape: shape.size)
    return outline, [shape for shape in shapes if shape is not outline]
