"""One door for moulds: a name of the library, or a GeoJSON, SVG or PNG file (docs/moulds.md)."""

from difflib import get_close_matches
from math import isfinite
from pathlib import Path

from raptor.core.errors import RaptorError
from raptor.core.files import read_input
from raptor.moulds.geojson import read_geojson
from raptor.moulds.geometry import Mould
from raptor.moulds.library import MOULDS

SUFFIXES = (".geojson", ".json", ".svg", ".png")
"""Suffixes of the files that `read_mould` reads."""


def find_mould(name: str | Path) -> Path:
    """The file of a mould: the path given, or the library's file where that is the name of one.

    Raises
    ------
    RaptorError
        Where there is neither.
    """
    path = Path(name)
    if path.suffix or path.exists():
        return path
    if str(name) not in MOULDS:
        near = get_close_matches(str(name), MOULDS, 1)
        hint = f"did you mean '{near[0]}'?" if near else f"the library has {', '.join(MOULDS)}"
        raise RaptorError(f"mould '{name}' is neither a file nor a mould of the library; {hint}")
    return MOULDS[str(name)]


def as_mould(mould: Mould | str | Path) -> Mould:
    """A mould as it is, or the one that a name of the library or a file stands for.

    Raises
    ------
    RaptorError
        As `read_mould`, and where it is anything else.
    """
    if isinstance(mould, Mould):
        return mould
    if isinstance(mould, (str, Path)):
        return read_mould(mould)
    raise RaptorError(
        f"a mould is of type {type(mould).__name__}; give a raptor.Mould, a name of the library or a file"
    )


def read_mould(path: str | Path, scale: float | None = None, mm_per_l0: float | None = None) -> Mould:
    """Read a mould of the library, or a file that holds one mould.

    Parameters
    ----------
    path : str or Path
        Name of a standard mould, or a file: GeoJSON (.geojson, .json), SVG (.svg) or PNG (.png).
    scale : float, optional
        l0 a unit of the file: of a GeoJSON coordinate (1 where not given), of an SVG user unit, or of a
        pixel. A drawing with a scale is put in the middle of the frame; without one, its page is the frame
        of 62.5 l0.

    Raises
    ------
    RaptorError
        Where the file is missing, unreadable, of another kind, or holds no mould that can be cast.
    """
    path = find_mould(path)
    if scale is not None and not (isfinite(scale) and scale > 0):
        raise RaptorError(f"scale is {scale}; give a positive number of l0 a unit of {path.name}")
    suffix = path.suffix.lower()
    # Imported here: a simulation job reads GeoJSON, and need not load what reads drawings.
    if suffix == ".svg":
        from raptor.moulds.svg import read_svg

        return read_svg(path).mould(path, scale, mm_per_l0)
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
