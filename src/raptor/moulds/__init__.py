"""Moulds: geometry, file formats, random generator, the paper's standard moulds."""

from raptor.moulds.geojson import moulds_by_id, read_moulds, write_moulds
from raptor.moulds.geometry import Circle, Mould, PolygonTether, Tether
from raptor.moulds.raster import MouldImage, mould_image
from raptor.moulds.reading import read_mould

__all__ = [
    "Circle",
    "Mould",
    "MouldImage",
    "PolygonTether",
    "Tether",
    "mould_image",
    "moulds_by_id",
    "read_mould",
    "read_moulds",
    "write_moulds",
]
