"""Moulds: geometry, file formats, random generator, the paper's standard moulds."""

from raptor.moulds.geojson import moulds_by_id, read_moulds, write_moulds
from raptor.moulds.geometry import IMAGE_SIZE, Circle, Mould, PolygonTether, Tether
from raptor.moulds.raster import MouldImage, mould_image, pixel_centres
from raptor.moulds.reading import read_mould

__all__ = [
    "IMAGE_SIZE",
    "Circle",
    "Mould",
    "MouldImage",
    "PolygonTether",
    "Tether",
    "mould_image",
    "moulds_by_id",
    "pixel_centres",
    "read_mould",
    "read_moulds",
    "write_moulds",
]
