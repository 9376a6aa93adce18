"""Reading of moulds: by library name, or from GeoJSON, SVG, DXF or a picture (docs/moulds.md)."""

from difflib import get_close_matches
from math import isfinite
from pathlib import Path

from raptor.core.errors import RaptorError
from raptor.core.files import read_input
from raptor.moulds.geometry import Mould
from raptor.moulds.library import MOULDS

PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".gif", ".webp")
SUFFIXES = (".geojson", ".json", ".svg", ".svgz", ".dxf", *PICTURES)
"""Suffixes of the files that `read_mould` reads."""


def find_mould(name: str | Path) -> Path:
    """The file of a mould: the given path, or that of the library mould of this name.

    A folder does not hide a library mould of its name.

    Raises
    ------
    RaptorError
        If there is neither.
    """
    path = Path(name)
    if str(name) in MOULDS and not path.is_file():
        return MOULDS[str(name)]
    if path.suffix or path.exists():
        return path
    near = get_close_matches(str(name), MOULDS, 1)
    hint = f"did you mean '{near[0]}'?" if near else f"the library has {', '.join(MOULDS)}"
    raise RaptorError(f"mould '{name}' is neither a file nor a mould of the library; {hint}")


def as_mould(mould: Mould | str | Path) -> Mould:
    """A mould itself, or the mould of a library name or file.

    Raises
    ------
    RaptorError
        As `read_mould`, and for any other type.
    """
    if isinstance(mould, Mould):
        return mould
    if isinstance(mould, (str, Path)):
        return read_mould(mould)
    raise RaptorError(
        f"a mould is of type {type(mould).__name__}; give a raptor.Mould, a library name or a file"
    )


def read_at_scale(path: str | Path, mould_scale: float) -> Mould:
    """Read a mould; library moulds are scaled, whereas people draw their own at the size to be cast.

    Raises
    ------
    RaptorError
        As `read_mould`.
    """
    path = find_mould(path)
    mould = read_mould(path)
    return mould.scaled(mould_scale) if path in MOULDS.values() else mould


def read_mould(
    path: str | Path, scale: float | None = None, mm_per_l0: float | None = None, page: int | None = None
) -> Mould:
    """Read a library mould, or a file that holds one mould.

    Without `scale` a drawing is fitted to the frame: its longest side becomes 52 l0. A GeoJSON within the
    frame, and an SVG whose page is a square of 62.5 user units, are in l0 already.

    Parameters
    ----------
    path : str or Path
        A library name, or a file: GeoJSON, SVG, DXF, or a picture (PNG, TIFF, JPEG, ...).
    scale : float, optional
        l0 per unit of the file: of a coordinate, of an SVG user unit, or of a pixel.
    mm_per_l0 : float, optional
        Millimetres per l0. For a file with a real unit (mm, cm, in, pt) it sets the scale, unless `scale`
        does; otherwise it only records the length of l0.
    page : int, optional
        Page of a picture with several, from 1.

    Raises
    ------
    RaptorError
        If the file is missing, unreadable, of another kind, or holds no mould that can be cast.
    """
    path = find_mould(path)
    for name, value in (("scale", scale), ("mm_per_l0", mm_per_l0)):
        if value is not None and not (isfinite(value) and value > 0):
            of = "l0 per unit" if name == "scale" else "mm per l0"
            raise RaptorError(f"{name} is {value}; give a positive number of {of} ({path.name})")
    suffix = path.suffix.lower()
    # Imported here, because simulation jobs read only GeoJSON.
    if suffix in (".svg", ".svgz"):
        from raptor.moulds.svg import read_svg as read
    elif suffix == ".dxf":
        from raptor.moulds.dxf import read_dxf as read
    elif suffix in PICTURES:
        from raptor.moulds.bitmap import read_bitmap

        return read_bitmap(path, page).mould(path, scale, mm_per_l0)
    elif suffix in SUFFIXES:
        from raptor.moulds.features import read_geojson

        return read_geojson(path, scale, mm_per_l0)
    else:
        read_input(path, "mould file", "a mould")  # reports a missing file whatever its suffix
        raise RaptorError(
            f"mould file {path} has the suffix '{path.suffix}'; a mould is read from {', '.join(SUFFIXES)}"
        )
    return read(path).mould(path, scale, mm_per_l0)
