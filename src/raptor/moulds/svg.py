"""Moulds drawn as SVG: the shapes that a renderer shows, distinguished by name or size (docs/moulds.md).

A shape is a visible path, polygon, polyline, rectangle, circle or ellipse; strokes, fills, text and images
are ignored. A path of several pieces is several shapes. An open piece is a shape if it is filled, otherwise
a line.
"""

import gzip
import re
from collections.abc import Iterator
from io import BytesIO
from math import isfinite, nan
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import shapely
import svgelements

from raptor.core.errors import RaptorError
from raptor.core.files import decoded, kind_of, read_input
from raptor.moulds.drawing import Drawing
from raptor.moulds.geometry import CIRCLE_SEGMENTS
from raptor.moulds.rendering import SHAPES, Drawn, drawn_shapes, tag_of
from raptor.moulds.shapes import Line, Page, Shape, circle_of, role_of

NAMESPACE = "http://www.w3.org/2000/svg"
SMOOTH = 1e-4  # of a shape's longer side: largest distance of a straightened curve from the drawn one
AGREED = 2e-3  # of a shape's longer side: largest distance from where the renderer draws it
CUT, WHOLE = 0.02, 0.98  # share of a shape left if clipped away, and if not clipped
LENGTHS = {"x", "y", "width", "height", "cx", "cy", "r", "rx", "ry", "x1", "y1", "x2", "y2"}
LENGTH = re.compile(r"\s*([+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?)\s*(px|pt|pc|mm|cm|in|%)?\s*")
PATH_DATA = re.compile(r"\s*([Mm][MmZzLlHhVvCcSsQqTtAaEe\d\s.,+-]*)?")
MILLIMETRES = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "pc": 25.4 / 6}
PIXEL = 25.4 / 96  # mm; a CSS pixel
DRAWN: Any = (
    svgelements.Path, svgelements.Polygon, svgelements.Polyline, svgelements.Rect, svgelements.Circle,
    svgelements.Ellipse, svgelements.SimpleLine,
)  # fmt: skip


def read_svg(path: Path) -> Drawing:
    """Read an SVG file that holds one mould.

    Raises
    ------
    RaptorError
        If the file is not SVG, or a shape in it cannot be read.
    """
    path = Path(path)
    where = f"mould file {path}"
    root = _root(read_input(path, "mould file", "an SVG drawing"), where)
    try:
        for element in root.iter():
            _require_readable(element)
        page, mm, pixels = _page(root)
        drawn = drawn_shapes(root, pixels)
        shapes: list[Shape] = []
        lines: list[Line] = []
        for shape, geometry in zip(drawn, _geometries([each.element for each in drawn], page), strict=True):
            for piece in _pieces(shape, geometry):
                (shapes if isinstance(piece, Shape) else lines).append(piece)  # type: ignore[arg-type]
    except RaptorError as error:
        raise RaptorError(f"{where}: {error}") from error
    except (ValueError, TypeError, AttributeError, IndexError, ArithmeticError) as error:
        raise RaptorError(f"{where} cannot be read: {error}; save it again as plain SVG") from error
    framed = page is not None and page.is_frame
    return Drawing(tuple(shapes), tuple(lines), page, mm=mm, l0=_scale(root, where), framed=framed)


def _root(content: bytes, where: str) -> Element:
    """The root element of an SVG document, compressed or not."""
    try:
        if content[:2] == b"\x1f\x8b":
            content = gzip.decompress(content)
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError, OSError, EOFError) as error:
        if content[:1].lstrip() == b"<" and b"<?xml" not in content[:200]:
            decoded(content, where)  # UTF-8, as it says no other; this names another encoding
        kind = "" if content.lstrip()[:1] == b"<" else f" (its content {kind_of(content)})"
        raise RaptorError(
            f"{where} is not SVG, or is truncated: {error}{kind}; save it again as plain SVG"
        ) from error
    if tag_of(root) != "svg":
        raise RaptorError(f"{where} is not SVG: its root is <{tag_of(root)}>; save it as plain SVG")
    if root.tag != f"{{{NAMESPACE}}}svg":
        raise RaptorError(f'{where} cannot be read: the root lacks the namespace xmlns="{NAMESPACE}"')
    return root


def _require_readable(element: Element) -> None:
    """Raise a RaptorError for a shape that a renderer would silently drop or truncate."""
    tag, attributes = tag_of(element), element.attrib
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
            if not LENGTH.fullmatch(attributes[key]) and attributes[key].strip() != "auto":
                raise ValueError(f"{key} must be a length")
    except ValueError as error:
        reason = f" ({error})" if str(error) else ""
        raise RaptorError(
            f"<{tag}> '{attributes.get('id', 'without id')}' cannot be read{reason}; draw it again, or "
            "delete it"
        ) from error


def _scale(root: Element, where: str) -> float | None:
    """The attribute data-l0: l0 per user unit."""
    text = root.get("data-l0")
    if text is None:
        return None
    try:
        value = float(text)
    except ValueError:
        value = nan
    if not (isfinite(value) and value > 0):
        raise RaptorError(f"{where}: data-l0 is '{text}'; give a positive number, l0 per user unit")
    return value


def _page(root: Element) -> tuple[Page | None, float | None, tuple[float, float]]:
    """The page in user units, millimetres per user unit if its size has a real unit, and its CSS pixels."""
    sides = [LENGTH.fullmatch(root.get(key, "")) for key in ("width", "height")]
    numbers = [float(side[1]) if side and side[4] != "%" and float(side[1]) > 0 else None for side in sides]
    units = [side[4] or "px" if side else "px" for side in sides]
    box = [float(value) for value in root.get("viewBox", "").replace(",", " ").split()]
    known = [n * MILLIMETRES.get(u, PIXEL) for n, u in zip(numbers, units, strict=True) if n is not None]
    real = len(known) == 2 and all(unit in MILLIMETRES for unit in units)
    if len(box) == 4 and min(box[2:]) > 0:
        if len(known) < 2:
            known = [box[2] * PIXEL, box[3] * PIXEL]
        mm = min(side / length for side, length in zip(known, box[2:], strict=True))
        page: Page | None = Page(box[0], -(box[1] + box[3]), box[2], box[3])
    else:
        page = Page(0, -known[1] / PIXEL, known[0] / PIXEL, known[1] / PIXEL) if len(known) == 2 else None
        known, mm = known if len(known) == 2 else [1000 * PIXEL] * 2, PIXEL
    return page, mm if real else None, (known[0] / PIXEL, known[1] / PIXEL)


def _geometries(elements: list[Element], page: Page | None) -> list[Any]:
    """Shapes in their own coordinates, from svgelements."""
    width, height = (page.width, page.height) if page else (1000.0, 1000.0)
    sheet = Element("svg", {"xmlns": NAMESPACE, "width": repr(width), "height": repr(height)})
    for number, element in enumerate(elements):
        kept = {
            k: v for k, v in element.attrib.items() if k in LENGTHS | {"d", "points"} and v.strip() != "auto"
        }
        sheet.append(Element(tag_of(element), kept | {"id": str(number)}))
    parsed = svgelements.SVG.parse(BytesIO(ElementTree.tostring(sheet)), reify=False)
    found = {part.id: part for part in parsed.elements() if isinstance(part, DRAWN)}
    return [found.get(str(number)) for number in range(len(elements))]


def _pieces(drawn: Drawn, geometry: Any) -> Iterator[Shape | Line]:
    """The pieces of a shape, in user units, y up: closed ones by size, and open ones."""
    name, role = _name(drawn), role_of(*drawn.words)
    if geometry is None:
        return
    (a, c, e), (b, d, f) = drawn.matrix
    path = abs(svgelements.Path(geometry) * svgelements.Matrix(a, b, c, d, e, f))
    _require_agreement(path, drawn, name)
    if drawn.left < CUT:
        return
    shapes = []
    for piece in path.as_subpaths():
        piece = svgelements.Path(piece)
        corners = np.array([(point.x, -point.y) for segment in piece for point in _points(segment)])
        corners = (
            corners[np.append(True, np.any(np.diff(corners, axis=0), axis=1))] if len(corners) else corners
        )
        if len(corners) < 2:
            continue
        span = float(np.ptp(corners, axis=0).max())
        meets = float(np.hypot(*(corners[-1] - corners[0]))) <= SMOOTH * span
        is_closed = isinstance(piece[-1], svgelements.Close) or drawn.filled or meets
        polygon = shapely.Polygon(corners) if is_closed and len(corners) > 2 else None
        if polygon is None or polygon.convex_hull.area == 0:
            yield Line(name, corners, role)
            continue
        if polygon.is_valid and circle_of(polygon) is None:
            polygon = polygon.simplify(SMOOTH * span)
        shapes.append(Shape(name, polygon, role))
    for number, shape in enumerate(sorted(shapes, key=lambda shape: -shape.size)):
        if drawn.left < WHOLE:
            raise RaptorError(
                f"{name} is cut by a clip or a mask; apply it, so that the shape ends where it is cut"
            )
        # The other pieces of a path called outline are tethers within its largest piece.
        yield Shape(name, shape.polygon, "tether") if number and role == "outline" else shape


def _require_agreement(path: Any, drawn: Drawn, name: str) -> None:
    """Raise a RaptorError if the renderer draws a shape elsewhere than it was read."""
    box = path.bbox()
    if box is None:
        return
    read = np.array([box[0], box[1], box[2] - box[0], box[3] - box[1]])
    if np.abs(read - drawn.box).max() > AGREED * max(drawn.box[2:].max(), read[2:].max()):
        raise RaptorError(
            f"{name} is drawn at {drawn.box.round(3).tolist()} (x, y, width, height) and written at "
            f"{read.round(3).tolist()}; convert it to a path (in Inkscape: Path, Object to Path)"
        )


def _name(drawn: Drawn) -> str:
    """A shape's name in messages: its id, or its kind and position in the drawing."""
    if drawn.words[0] and not drawn.words[0].startswith("raptor-"):
        return f"'{drawn.words[0]}'"
    x, y = drawn.box[:2] + drawn.box[2:] / 2
    return f"<{tag_of(drawn.element)}> at ({x:.4g}, {y:.4g})"


def _points(segment: Any) -> list[Any]:
    """Points along a segment of a path, without its start."""
    if isinstance(segment, (svgelements.CubicBezier, svgelements.QuadraticBezier, svgelements.Arc)):
        return [segment.point(t) for t in np.linspace(0, 1, CIRCLE_SEGMENTS + 1)[1:]]
    return [] if segment.end is None else [segment.end]
