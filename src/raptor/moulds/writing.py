"""Moulds as drawings for a workshop: SVG and DXF, in millimetres where a mould has a real unit.

The SVG's page is the frame, so that `read_mould` gives the same mould; cutters read its size in mm.
"""

from io import StringIO
from pathlib import Path

import shapely

from raptor.core.files import write_text
from raptor.frame import IMAGE_SIZE
from raptor.moulds.geometry import Circle, Mould

DIGITS = 4  # decimals of a coordinate in l0


def write_svg(path: Path, mould: Mould) -> None:
    """Write a mould as SVG: outline, then tethers in red; user units are l0."""
    half, real = IMAGE_SIZE / 2, mould.mm_per_l0
    side = f"{IMAGE_SIZE * real:.6g}mm" if real else f"{IMAGE_SIZE:g}"
    shapes = [f'<path id="outline" fill="#bbb" d="{_path(mould.outline)}"/>']
    for number, tether in enumerate(mould.tethers, start=1):
        name = f'id="tether_{number}" fill="red"'
        if isinstance(tether, Circle):
            x, y, radius = (_text(value) for value in (tether.x, -tether.y, tether.radius))
            shapes.append(f'<circle {name} cx="{x}" cy="{y}" r="{radius}"/>')
        else:
            shapes.append(f'<path {name} d="{_path(tether.polygon)}"/>')
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{side}" height="{side}" '
        f'viewBox="{-half:g} {-half:g} {IMAGE_SIZE:g} {IMAGE_SIZE:g}">'
    )
    write_text(path, "\n".join([head, *(f"  {shape}" for shape in shapes), "</svg>"]) + "\n")


def write_dxf(path: Path, mould: Mould) -> None:
    """Write a mould as DXF, layers `outline` and `tether`, in mm if it has a real unit, else in l0."""
    from ezdxf import units
    from ezdxf.filemanagement import new

    document = new("R2010")
    document.units = units.MM if mould.mm_per_l0 else 0
    scale, space = mould.mm_per_l0 or 1.0, document.modelspace()
    for layer in ("outline", "tether"):
        document.layers.add(layer)
    space.add_lwpolyline(_corners(mould.outline, scale), close=True, dxfattribs={"layer": "outline"})
    for tether in mould.tethers:
        about = {"layer": "tether"}
        if isinstance(tether, Circle):
            space.add_circle((scale * tether.x, scale * tether.y), scale * tether.radius, dxfattribs=about)
        else:
            space.add_lwpolyline(_corners(tether.polygon, scale), close=True, dxfattribs=about)
    content = StringIO()
    document.write(content)
    write_text(path, content.getvalue())


def _path(polygon: shapely.Polygon) -> str:
    """Path data of a polygon, y down."""
    corners = [f"{_text(x)} {_text(-y)}" for x, y in polygon.exterior.coords[:-1]]
    return f"M {' L '.join(corners)} Z"


def _corners(polygon: shapely.Polygon, scale: float) -> list[tuple[float, float]]:
    return [(scale * x, scale * y) for x, y in polygon.exterior.coords[:-1]]


def _text(value: float) -> str:
    return f"{round(value, DIGITS) + 0.0:g}"
