"""Moulds from GeoJSON as people and geographic programs write it: shapely, QGIS, GDAL (docs/moulds.md).

Polygons with or without holes, in one feature or several, in parts or collections; points with a radius and
lines that close a shape. A mould within the frame is in l0; any other is fitted to it.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from raptor.core.errors import RaptorError
from raptor.frame import IMAGE_SIZE
from raptor.moulds.drawing import SMALLEST, Drawing
from raptor.moulds.geojson import from_feature, polygon_of, read_features, tethers_of
from raptor.moulds.geometry import Circle, Mould
from raptor.moulds.shapes import Line, Page, Shape, role_of

FRAME = Page(-IMAGE_SIZE / 2, -IMAGE_SIZE / 2, IMAGE_SIZE, IMAGE_SIZE)
DAMAGE = (
    AttributeError, TypeError, KeyError, IndexError, ValueError, OverflowError, shapely.GEOSException,
)  # fmt: skip
NAMES = ("role", "kind", "type", "mould", "name", "layer", "Layer", "id")
"""Properties that may give a feature's role."""


def read_geojson(path: Path, scale: float | None = None, mm_per_l0: float | None = None) -> Mould:
    """Read a GeoJSON file that holds one mould.

    Raises
    ------
    RaptorError
        If it is not GeoJSON, or does not hold exactly one mould that can be cast.
    """
    path = Path(path)
    where = f"mould file {path}"
    features = read_features(path)
    properties = (features[0].get("properties") or {}) if len(features) == 1 else {}
    try:
        mm_per_l0 = properties.get("mm_per_l0") if mm_per_l0 is None else mm_per_l0
        if scale is None and len(features) == 1 and _is_in_frame(features[0].get("geometry") or {}):
            return replace(from_feature(features[0], path), mm_per_l0=mm_per_l0)
        _require_one_mould(features, where)
        drawn = [each for feature in features for each in _shapes(feature, where)]
    except RecursionError:
        raise RaptorError(f"{where} is nested too deeply; a mould is a Polygon or a few") from None
    except RaptorError:
        raise
    except DAMAGE as error:
        raise RaptorError(f"{where} is not GeoJSON of a mould: {error}") from error
    if not drawn:
        raise RaptorError(f"{where} draws nothing that encloses an area; a Polygon is expected")
    shapes = tuple(shape for shape in drawn if isinstance(shape, Shape))
    _require_one_piece(shapes, where)
    lines = tuple(line for line in drawn if isinstance(line, Line))
    mould = Drawing(shapes, lines, FRAME, "coordinate unit", framed=True).mould(path, scale, mm_per_l0)
    return replace(mould, name=str(properties.get("mould", path.stem)))


def _is_in_frame(geometry: dict[str, Any]) -> bool:
    """Whether a polygon has no corner outside the frame."""
    if geometry.get("type") not in ("Polygon", "MultiPolygon"):
        return False
    rings = geometry.get("coordinates") or []
    parts = [rings] if geometry["type"] == "Polygon" else rings
    corners = [float(value) for rings in parts for ring in rings for corner in ring for value in corner[:2]]
    if not corners:
        return True  # NaN and emptiness are reported later
    places = np.reshape(corners, (-1, 2))
    outside = np.abs(places).max() > IMAGE_SIZE / 2
    return not (outside or 0 < np.ptp(places, axis=0).max() < SMALLEST)


def _shapes(feature: dict[str, Any], where: str) -> Iterator[Shape | Line]:
    """The shapes of a feature: its outline, its holes and the tethers among its properties."""
    properties = feature.get("properties") or {}
    words = [str(properties[name]) for name in NAMES if properties.get(name) is not None]
    words += [str(feature["id"])] if "id" in feature else []
    name, role = f"'{words[0]}'" if words else "of GeoJSON", role_of(*words)
    for tether in tethers_of(properties, where):
        yield Shape("among the properties", tether.polygon, "tether")
    for geometry in _geometries(feature.get("geometry") or {}):
        kind, given = geometry.get("type"), geometry.get("coordinates") or []
        if kind == "Point":
            if properties.get("radius") is not None:
                x, y, radius = float(given[0]), float(given[1]), float(properties["radius"])
                yield Shape(name, Circle(x, y, radius).polygon, role or "tether")
        elif kind in ("LineString", "MultiLineString"):
            for line in [given] if kind == "LineString" else given:
                yield Line(name, np.array([corner[:2] for corner in line], dtype=float), role)
        elif kind in ("Polygon", "MultiPolygon"):
            for rings in [given] if kind == "Polygon" else given:
                outer, *holes = [polygon_of(ring, f"{where}: the outline") for ring in rings]
                yield Shape(name, outer, role)
                yield from (Shape(f"that is a hole of {name}", hole, "tether") for hole in holes)
        else:
            raise RaptorError(f"{where}: geometry is {kind}; a Polygon is expected")


def _geometries(geometry: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The geometries of a collection, or a single geometry."""
    if geometry.get("type") == "GeometryCollection":
        for part in geometry["geometries"]:
            yield from _geometries(part)
    elif geometry.get("type") == "MultiPoint":
        yield from ({"type": "Point", "coordinates": point} for point in geometry["coordinates"])
    else:
        yield geometry


def _require_one_mould(features: list[dict[str, Any]], where: str) -> None:
    """Raise a RaptorError if several features are moulds with their own tethers."""
    count = sum("tethers" in (feature.get("properties") or {}) for feature in features)
    if count > 1:
        raise RaptorError(
            f"{where} gives the depression in {count} pieces; a mould is one connected outline, so keep one"
        )


def _require_one_piece(shapes: tuple[Shape, ...], where: str) -> None:
    """Raise a RaptorError if shapes not named tether lie apart from each other."""
    bodies = sorted((shape for shape in shapes if shape.role != "tether"), key=lambda shape: -shape.size)
    apart = [shape for shape in bodies[1:] if not bodies[0].polygon.buffer(0).intersects(shape.polygon)]
    if apart:
        raise RaptorError(
            f"{where} gives the depression in {1 + len(apart)} pieces ({bodies[0].name}, {apart[0].name}); a "
            "mould is one connected outline, so keep one"
        )
