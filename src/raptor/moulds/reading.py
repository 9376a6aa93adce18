"""One door for mould files: GeoJSON, SVG or PNG, by the file's suffix (docs/moulds.md)."""

from math import isfinite
from pathlib import Path

from raptor.core.errors import RaptorError
from raptor.core.files import read_input
from raptor.moulds.geojson import read_geojson
from raptor.moulds.geometry import Mould

SUFFIXES = (".geojson", ".json", ".svg", ".png")
"""Suffixes of the files that `read_mould` reads."""


def read_mould(path: Path, scale: float | None = None) -> Mould:
    """Read a file that holds one mould.

    Parameters
    ----------
    path : Path
        GeoJSON (.geojson, .json), SVG (.svg) or PNG (.png).
    scale : float, optional
        l0 a unit of the file: of a GeoJSON coordinate (1 where not given), of an SVG user unit, or of a
        pixel. A drawing with a scale is put in the middle of the frame; without one, its page is the frame
        of 62.5 l0.

    Raises
    ------
    RaptorError
        Where the file is missing, unreadable, of another kind, or holds no mould that can be cast.
    """
    path = Path(path)
    if scale is not None and not (isfinite(scale) and scale > 0):
        raise RaptorError(f"scale is {scale}; give a positive number of l0 a unit of {path.name}")
    suffix = path.suffix.lower()
    # Imported here: a simulation job reads GeoJSON, and need not load what reads drawings.
    if suffix == ".svg":
        from raptor.moulds.svg import read_svg

        return read_svg(path, scale)
    if suffix == ".png":
        from raptor.moulds.bitmap import read_bitmap

        return read_bitmap(path, scale)
    if suffix in SUFFIXES:
        mould = read_geojson(path)
        return mould if scale is None else mould.scaled(scale)
    read_input(path, "mould file", "a mould")  # a missing file is called missing, whatever its suffix
    raise RaptorError(
        f"mould file {path} has the suffix '{path.suffix}'; a mould is read from {', '.join(SUFFIXES)}"
    )
