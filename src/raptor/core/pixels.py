"""Pixels of a picture of any common format, as a viewer displays them: orientation, colours, pages."""

import logging
import struct
import warnings
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps, UnidentifiedImageError

from raptor.core.errors import RaptorError
from raptor.core.files import kind_of, read_input

MOST_PIXELS = 150_000_000  # of one page
# Pillow and tifffile report damage by many kinds of exceptions.
DAMAGE = (
    OSError, SyntaxError, ValueError, EOFError, KeyError, IndexError, TypeError, AttributeError, RuntimeError,
    ArithmeticError, MemoryError, struct.error, zlib.error,
)  # fmt: skip
TURNS: dict[int, Callable[[NDArray[Any]], NDArray[Any]]] = {
    2: lambda p: p[:, ::-1],
    3: lambda p: p[::-1, ::-1],
    4: lambda p: p[::-1],
    5: lambda p: p.swapaxes(0, 1),
    6: lambda p: np.rot90(p, -1),
    7: lambda p: p.swapaxes(0, 1)[::-1, ::-1],
    8: lambda p: np.rot90(p),
}
"""Transformation for each orientation of EXIF and TIFF."""


@dataclass(frozen=True)
class Pixels:
    """One picture, row 0 at the top.

    Parameters
    ----------
    colours : array (row, column, 1 or 3)
        Grey, or red, green and blue; from 0 to 1, except that floating-point files keep their values.
    opacity : array (row, column) or None
        From 0 to 1; None if the file has none.
    """

    colours: NDArray[np.float64]
    opacity: NDArray[np.float64] | None = None

    @property
    def on_white(self) -> NDArray[np.float64]:
        """Red, green and blue (row, column, 3) on a white background."""
        rgb = np.broadcast_to(self.colours, (*self.colours.shape[:2], 3))
        if self.opacity is None:
            return np.array(rgb)
        return np.asarray(rgb * self.opacity[..., None] + 1 - self.opacity[..., None])


def read_pixels(path: Path, what: str = "picture", page: int | None = None) -> Pixels:
    """Read a picture; messages call it `what`, and pages count from 1.

    Raises
    ------
    RaptorError
        If the file is missing, not a picture or too large, or none of several pages is chosen.
    """
    path = Path(path)
    content = read_input(path, what, "a picture")
    where = f"{what} {path}"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of Pillow about size and metadata
            read = _tiff if content[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+") else _other
            return read(content, where, page)
    except RaptorError:
        raise
    except UnidentifiedImageError as error:
        raise RaptorError(
            f"{where} is no picture that can be read: its content {kind_of(content)}; save it as PNG, TIFF "
            "or JPEG"
        ) from error
    except DAMAGE as error:
        raise RaptorError(
            f"{where} is truncated or damaged: {error or type(error).__name__}; save it again"
        ) from error
    except Image.DecompressionBombError as error:
        raise RaptorError(f"{where} is too large: {error}; reduce it") from error


def _other(content: bytes, where: str, page: int | None) -> Pixels:
    """A picture that Pillow reads."""
    picture: Image.Image = Image.open(BytesIO(content))
    _require_size(*picture.size, where)
    # The other pictures of a camera's MPO file are previews.
    count = 1 if picture.format == "MPO" else int(getattr(picture, "n_frames", 1))
    picture.seek(_page(count, page, where) - 1)
    picture.load()
    picture = ImageOps.exif_transpose(picture)
    mode, opacity = picture.mode, None
    if mode in ("LA", "La", "PA", "RGBA", "RGBa") or "transparency" in picture.info:
        rgba = _scaled(np.asarray(picture.convert("RGBA")))
        opacity, colours = rgba[..., 3], rgba[..., :3]
        colours = colours[..., :1] if mode in ("LA", "La", "L") else colours
    elif mode.startswith("I") or mode == "F":  # 16-bit and 32-bit grey
        values = np.asarray(picture)
        colours = _scaled(values if values.dtype != np.int32 else _narrowed(values))[..., None]
    else:
        grey = mode in ("1", "L")
        colours = _scaled(np.asarray(picture.convert("L" if grey else "RGB")))
        colours = colours[..., None] if grey else colours
    return Pixels(np.asarray(colours), opacity)


def _tiff(content: bytes, where: str, page: int | None) -> Pixels:
    """A page of a TIFF file; time points, slices and channels count as pages."""
    import tifffile  # here, because it is slow to load and rarely needed

    logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # damage is raised below
    with tifffile.TiffFile(BytesIO(content)) as file:
        planes = [
            (series, number)
            for series in file.series
            if not series.keyframe.is_reduced
            for number in range(_planes(series))
        ]
        series, number = planes[_page(len(planes), page, where) - 1]
        key = series.keyframe
        axes, shape = series.axes, dict(zip(series.axes, series.shape, strict=True))
        if not {"Y", "X"} <= set(axes):
            raise RaptorError(f"{where} holds an array of shape {series.shape} and no picture")
        _require_size(shape["X"], shape["Y"], where)
        values = series.asarray()
        order = [axes.index(axis) for axis in axes if axis not in "YXS"]
        order += [axes.index(axis) for axis in "YXS" if axis in axes]
        values = values.transpose(order).reshape(-1, shape["Y"], shape["X"], shape.get("S", 1))[number]
        kind, table = str(getattr(key.photometric, "name", "")), key.colormap
        tag = key.tags.get("Orientation")
        turn = TURNS.get(int(tag.value) if tag is not None else 1)
    if kind == "PALETTE" and table is not None:
        values = np.moveaxis(table, 0, -1)[values[..., 0]]
    colours = _scaled(values)
    if kind == "MINISWHITE":
        colours = 1 - colours
    if turn is not None:
        colours = turn(colours)
    samples = colours.shape[-1]
    if kind == "SEPARATED" and samples >= 4:
        return Pixels((1 - colours[..., :3]) * (1 - colours[..., 3:4]))
    if samples > 4:
        raise RaptorError(f"{where} has {samples} colours a pixel; save it as grey or RGB")
    has_opacity = samples in (2, 4)
    return Pixels(
        np.ascontiguousarray(colours[..., : samples - has_opacity]), colours[..., -1] if has_opacity else None
    )


def _planes(series: Any) -> int:
    """Pictures of a TIFF series."""
    return int(np.prod([n for axis, n in zip(series.axes, series.shape, strict=True) if axis not in "YXS"]))


def _page(count: int, page: int | None, where: str) -> int:
    """The page to read, from 1; raises if it does not exist, or if none of several is chosen."""
    if count == 0:
        raise RaptorError(f"{where} is truncated or damaged: it holds no picture; save it again")
    if page is None and count > 1:
        raise RaptorError(
            f"{where} holds {count} pages (time points, slices or channels); give --page 1 to {count}"
        )
    page = 1 if page is None else page
    if not 1 <= page <= count:
        raise RaptorError(f"{where} has no page {page}; it holds {count}")
    return page


def _require_size(width: int, height: int, where: str) -> None:
    if width * height > MOST_PIXELS:
        most = f"{MOST_PIXELS // 1_000_000} million"
        raise RaptorError(f"{where} is {width} x {height} pixels large, more than {most}; reduce it")


def _narrowed(values: NDArray[np.int32]) -> NDArray[Any]:
    """Pillow's 32-bit integers as the 16 bits of the file, if they fit."""
    return values.astype(np.uint16) if values.min() >= 0 and values.max() < 65536 else values


def _scaled(values: NDArray[Any]) -> NDArray[np.float64]:
    """Integers over the largest of their type, booleans as 0 and 1; floating point unchanged."""
    if values.dtype.kind in "iu":
        return np.asarray(values * (1 / np.iinfo(values.dtype).max))
    return np.asarray(values, dtype=np.float64)
