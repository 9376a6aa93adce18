"""Mould files: GeoJSON, one feature per mould, tethers in its properties (see docs/data.md)."""

import json
from collections.abc import Container, Iterable
from difflib import get_close_matches
from math import isfinite
from pathlib import Path
from typing import Any

import shapely

from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path, kind_of, read_text
from raptor.moulds.geometry import Circle, Mould, PolygonTether, Tether

GEOMETRIES = ("Polygon", "MultiPolygon", "LineString", "MultiLineString", "GeometryCollection")
PROPERTIES = ("mould", "description", "source", "tethers", "symmetry", "area", "mm_per_l0", "family")


def read_moulds(path: Path, only: Container[str] | None = None) -> list[Mould]:
    """Read the moulds of a FeatureCollection, or those whose ids are in `only`.

    Raises
    ------
    RaptorError
        If the file is missing, empty or not GeoJSON, or a mould in it cannot be cast.
    """
    path = Path(path)
    features = read_features(path)
    try:
        return [from_feature(f, path) for f in features if only is None or _name(f, path) in only]
    except (AttributeError, TypeError, KeyError, IndexError, OverflowError) as error:
        raise RaptorError(f"mould file {path} is not GeoJSON of a mould: {error}") from error


def read_features(path: Path) -> list[dict[str, Any]]:
    """The features of a GeoJSON file; a bare geometry is one.

    Raises
    ------
    RaptorError
        If the file is missing, empty or not GeoJSON, or holds no feature.
    """
    path = Path(path)
    text = read_text(path, "mould file", "a GeoJSON polygon")
    try:
        document = json.loads(text)
    except RecursionError:
        raise RaptorError(f"mould file {path} is nested too deeply; a mould is a Polygon or a few") from None
    except ValueError as error:  # not JSON, or a number of thousands of digits
        found = "" if text.lstrip()[:1] in "[{" else f"; its content {kind_of(text[:200].encode())}"
        raise RaptorError(f"mould file {path} is not GeoJSON: {str(error).split(';')[0]}{found}") from error
    kind = document.get("type") if isinstance(document, dict) else None
    features: list[Any] = []
    if kind == "FeatureCollection":
        features = document.get("features") or []
    elif kind == "Feature":
        features = [document]
    elif kind in GEOMETRIES:
        features = [{"geometry": document, "properties": {}}]
    else:
        raise RaptorError(
            f"mould file {path} holds {kind or 'no GeoJSON type'}; a Feature, a FeatureCollection "
            "or a Polygon is expected"
        )
    if not features or not all(isinstance(feature, dict) for feature in features):
        raise RaptorError(f"mould file {path} holds no mould; one feature with a Polygon is expected")
    return features


def moulds_by_id(path: Path, only: Container[str] | None = None) -> dict[str, Mould]:
    """The moulds of `read_moulds` by id; raises the same errors."""
    return {mould.name: mould for mould in read_moulds(path, only)}


def write_moulds(path: Path, moulds: Iterable[Mould]) -> None:
    """Write moulds as a FeatureCollection, atomically."""
    collection = {
        "type": "FeatureCollection",
        "description": "RAPTOR moulds; lengths in l0, origin at the image centre",
        "features": [mould.as_feature() for mould in moulds],
    }
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(collection, indent=1) + "\n", encoding="utf-8")


def _name(feature: dict[str, Any], path: Path) -> str:
    return str((feature.get("properties") or {}).get("mould", path.stem))


def from_feature(feature: dict[str, Any], path: Path = Path("GeoJSON")) -> Mould:
    """A mould from a GeoJSON feature, the inverse of `Mould.as_feature`; messages name the file `path`.

    Raises
    ------
    RaptorError
        If it cannot be cast.
    """
    properties = feature.get("properties") or {}
    name = _name(feature, path)
    where = f"mould file {path}, {name}"
    geometry = feature.get("geometry") or {}
    parts = geometry.get("coordinates") or []
    if geometry.get("type") == "MultiPolygon":
        if len(parts) != 1:
            raise RaptorError(
                f"{where}: the depression is given in {len(parts)} pieces; a mould is one connected outline"
            )
        parts = parts[0]
    elif geometry.get("type") != "Polygon":
        raise RaptorError(f"{where}: geometry is {geometry.get('type')}; a Polygon is expected")
    _require_known(properties, where)
    rings = [polygon_of(ring, f"{where}: the outline") for ring in parts or [[]]]
    outline = shapely.Polygon(rings[0].exterior, [hole.exterior for hole in rings[1:]])
    tethers = tethers_of(properties, where)
    symmetry = str(properties.get("symmetry", "unknown"))
    try:
        return Mould(
            outline,
            tethers,
            symmetry,
            name,
            properties.get("mm_per_l0"),
            family=str(properties.get("family", "")),
        )
    except RaptorError as error:
        raise RaptorError(f"mould file {path}: {error}") from error


def tethers_of(properties: dict[str, Any], where: str) -> tuple[Tether, ...]:
    """The tethers among a feature's properties, which GDAL writes as text.

    Raises
    ------
    RaptorError
        If one is neither a circle nor a polygon.
    """
    entries = properties.get("tethers") or []
    if isinstance(entries, str):
        try:
            entries = json.loads(entries)
        except ValueError as error:
            raise RaptorError(f"{where}: its tethers are not a list: {error}") from error
    if not isinstance(entries, list):
        raise RaptorError(f"{where}: its tethers are not a list")
    return tuple(_tether(entry, f"{where}: tether {n}") for n, entry in enumerate(entries, start=1))


def _require_known(properties: dict[str, Any], where: str) -> None:
    """Raise a RaptorError for a misspelt property; properties of other programs are ignored."""
    for key in set(properties) - set(PROPERTIES):
        near = get_close_matches(key.lower(), PROPERTIES, 1, 0.8)
        if near and near[0] != key.lower():
            raise RaptorError(f"{where}: unknown property '{key}'; did you mean '{near[0]}'?")


def _tether(entry: Any, what: str) -> Tether:
    if isinstance(entry, dict) and set(entry) == {"polygon"}:
        return PolygonTether(polygon_of(entry["polygon"], what))
    if isinstance(entry, dict) and set(entry) == {"x", "y", "radius"}:
        try:
            values = [float(entry[key]) for key in ("x", "y", "radius")]
            if not all(map(isfinite, values)):
                raise ValueError("all must be finite")
            return Circle(*values)
        except (TypeError, ValueError, OverflowError) as error:
            raise RaptorError(f"{what}: x, y and radius must be numbers ({error})") from error
    raise RaptorError(f'{what} must be {{"x", "y", "radius"}} or {{"polygon": [[x, y], ...]}}')


def polygon_of(ring: Any, what: str) -> shapely.Polygon:
    """A polygon from [x, y, ...] corners; messages call it `what`.

    Raises
    ------
    RaptorError
        If it has less than three corners, or one is not finite.
    """
    try:
        if len(ring) < 3:
            raise ValueError("at least three corners are needed")
        corners = [(float(corner[0]), float(corner[1])) for corner in ring]
        if not all(isfinite(value) for corner in corners for value in corner):
            raise ValueError("every coordinate must be a finite number")
        return shapely.Polygon(corners)
    except (TypeError, ValueError, IndexError, KeyError, OverflowError) as error:
        raise RaptorError(f"{what} is not a list of [x, y] corners: {error}") from error
