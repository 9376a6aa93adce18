"""Pictures of tissues: grey-scale photographs and two-valued masks."""

from dataclasses import dataclass
from math import ceil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from skimage import color, io, transform, util

from raptor.core.errors import RaptorError

LONGEST_SIDE = 1600  # pixels; a larger picture is reduced by an integer factor
SMALLEST_SIDE = 32  # pixels; needed to find an outline


@dataclass(frozen=True)
class Picture:
    """A grey-scale picture.

    Parameters
    ----------
    values : array (row, column)
        Brightness from 0 to 1, row 0 at the top.
    mask : bool
        Whether it has two values only.
    reduction : int
        Pixels of the file along the side of one pixel here.
    """

    values: NDArray[np.float64]
    mask: bool
    reduction: int = 1


def read_picture(path: Path) -> Picture:
    """Read a photograph or a mask; colours become luminance, transparency is ignored.

    Raises
    ------
    RaptorError
        If the file is missing, not an image, a stack of images, too small or of one value.
    """
    path = Path(path)
    if not path.is_file():
        raise RaptorError(f"image {path} does not exist; check the path")
    try:
        pixels = np.asarray(io.imread(path))
    except Exception as error:  # each format's reader raises its own errors
        raise RaptorError(f"{path} is not an image that can be read; give a PNG, TIFF or JPEG") from error
    if pixels.ndim == 3 and pixels.shape[-1] in (2, 3, 4):
        pixels = pixels[..., 0] if pixels.shape[-1] == 2 else color.rgb2gray(pixels[..., :3])
    if pixels.ndim != 2:
        raise RaptorError(f"{path} holds an array of shape {pixels.shape}; give one picture, not a stack")
    if min(pixels.shape) < SMALLEST_SIDE:
        raise RaptorError(
            f"{path} is {pixels.shape[1]} x {pixels.shape[0]} pixels; at least {SMALLEST_SIDE} are needed"
        )
    return as_picture(pixels, str(path))


def as_picture(pixels: NDArray[np.generic], name: str) -> Picture:
    """A picture from grey values (row, column) of any type; raises if all are equal or one is NaN."""
    values = np.asarray(util.img_as_float64(pixels) if pixels.dtype.kind != "f" else pixels, np.float64)
    if not np.isfinite(values).all():
        raise RaptorError(f"{name} contains NaN or infinity; write it without them")
    levels = np.unique(values)[:3]
    if len(levels) < 2:
        raise RaptorError(f"{name} has the same value everywhere, so it shows no tissue")
    values = (values - min(0.0, float(values.min()))) / (values.max() - min(0.0, float(values.min())))
    reduction = ceil(max(values.shape) / LONGEST_SIDE)
    rows, columns = (side // reduction * reduction for side in values.shape)
    if reduction > 1:
        values = transform.downscale_local_mean(values[:rows, :columns], (reduction, reduction))
    if len(levels) == 2:  # two values, whatever they are, make a mask
        low, high = float(values.min()), float(values.max())
        values = (values - low) / (high - low)
    return Picture(values, len(levels) == 2, reduction)
