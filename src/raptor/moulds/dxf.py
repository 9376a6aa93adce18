"""Moulds from CAD drawings: the model space of a DXF file, read by ezdxf (docs/moulds.md).

Closed polylines, circles, ellipses and splines are shapes; lines and arcs count if they close one together.
Layers that are off, frozen or not printed, text, dimensions and points are ignored. The name of a layer or
block gives the role of its content, like that of an SVG group.
"""

import logging
import struct
from collections.abc import Iterator
from io import BytesIO
from itertools import islice
from pathlib import Path

import numpy as np
import shapely
from ezdxf import path as paths
from ezdxf import recover
from ezdxf.addons.drawing.properties import RenderContext
from ezdxf.disassemble import recursive_decompose
from ezdxf.document import Drawing as Document
from ezdxf.entities.dxfgfx import DXFGraphic
from ezdxf.entities.insert import Insert
from ezdxf.entities.polygon import DXFPolygon
from ezdxf.enums import InsertUnits
from ezdxf.lldxf.const import DXFError
from ezdxf.lldxf.tagger import binary_tags_loader
from ezdxf.units import conversion_factor

from raptor.core.errors import RaptorError
from raptor.core.files import kind_of, read_input
from raptor.moulds.drawing import Drawing
from raptor.moulds.shapes import Line, Shape, role_of

# ezdxf reports damage by many kinds of exceptions.
DAMAGE = (
    DXFError, struct.error, OSError, ValueError, KeyError, IndexError, TypeError, AttributeError,
    AssertionError, ArithmeticError, RecursionError,
)  # fmt: skip
BINARY = b"AutoCAD Binary DXF"
DRAWN = {"LINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", "LWPOLYLINE", "POLYLINE", "SOLID", "TRACE", "3DFACE"}
HATCHES = {"HATCH", "MPOLYGON"}  # some programs write nothing else
FLAT = 1e-4  # of a shape's longer side: largest distance of a straightened curve from the drawn one
MOST_SHAPES = 20_000


def read_dxf(path: Path) -> Drawing:
    """Read a DXF file that holds one mould; a real unit is taken from its header ($INSUNITS).

    Raises
    ------
    RaptorError
        If the file is not DXF, or draws too much.
    """
    path = Path(path)
    where = f"mould file {path}"
    document = _document(read_input(path, "mould file", "a DXF drawing"), where)
    try:
        drawn = list(islice(_pieces(document), MOST_SHAPES))
    except DAMAGE as error:
        raise RaptorError(f"{where} is damaged: {error}; save it again as DXF") from error
    if len(drawn) == MOST_SHAPES:
        raise RaptorError(f"{where} draws {MOST_SHAPES} lines or more; keep outline and tethers only")
    shapes = tuple(shape for shape in drawn if isinstance(shape, Shape))
    lines = tuple(line for line in drawn if isinstance(line, Line))
    unit = document.units
    mm = float(conversion_factor(InsertUnits(unit), InsertUnits.Millimeters)) if unit else None
    return Drawing(shapes, lines, unit="drawing unit", mm=mm)


def _document(content: bytes, where: str) -> Document:
    """A DXF document, repaired if possible."""
    logging.getLogger("ezdxf").setLevel(logging.ERROR)
    try:
        if content.startswith(BINARY):
            # As text, because ezdxf repairs only text.
            content = "".join(tag.dxfstr() for tag in binary_tags_loader(content)).encode(errors="replace")
        document, auditor = recover.read(BytesIO(content))
    except DAMAGE as error:
        raise RaptorError(
            f"{where} is not DXF, or is truncated: its content {kind_of(content)} ({error}); save it "
            "again as DXF (AutoCAD 2000 or later)"
        ) from error
    if auditor.has_errors:
        first = auditor.errors[0].message
        raise RaptorError(f"{where} is damaged: {first}; save it again as DXF")
    return document


def _pieces(document: Document) -> Iterator[Shape | Line]:
    """The shapes and lines of the model space, y up, drawing units."""
    context = RenderContext(document, export_mode=True)  # as printed
    for outer in document.modelspace():
        if not isinstance(outer, DXFGraphic) or outer.dxftype() == "DIMENSION":
            continue
        named = [outer.dxf.get("layer", ""), outer.dxf.get("name", "") if isinstance(outer, Insert) else ""]
        for entity in recursive_decompose([outer]):
            kind = entity.dxftype()
            if (
                not isinstance(entity, DXFGraphic)
                or kind not in DRAWN | HATCHES
                or not context.resolve_visible(entity)
            ):
                continue
            layer = entity.dxf.get("layer", "0")
            name = f"{kind} {entity.dxf.get('handle') or 'in ' + named[1]} on layer '{layer}'"
            yield from _traced(entity, name, role_of(layer, *named))


def _traced(entity: DXFGraphic, name: str, role: str) -> Iterator[Shape | Line]:
    """An entity as closed and open lines."""
    for path in (
        paths.from_hatch(entity) if isinstance(entity, DXFPolygon) else paths.make_path(entity).sub_paths()
    ):
        box = paths.bbox([path], fast=True)
        span = max(box.size.x, box.size.y) if box.has_data else 0.0
        if not span > 0:
            continue
        corners = np.array([(point.x, point.y) for point in path.flattening(FLAT * span, segments=16)])
        corners = corners[np.append(True, np.any(np.diff(corners, axis=0), axis=1))]
        closed = path.is_closed or float(np.hypot(*(corners[-1] - corners[0]))) <= FLAT * span
        polygon = shapely.Polygon(corners) if closed and len(corners) > 2 else None
        if polygon is not None and polygon.convex_hull.area > 0:
            yield Shape(name, polygon, role)
        elif len(corners) > 1:
            yield Line(name, corners, role)
