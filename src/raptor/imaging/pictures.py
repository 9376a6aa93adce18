"""Pictures of tissues: grey-scale photographs and two-valued masks."""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from skimage import color, transform, util

from raptor.core.errors import RaptorError
from raptor.core.pixels import read_pixels

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


def read_picture(path: Path, page: int | None = None, channel: str | None = None) -> Picture:
    """Read a photograph or a mask as a viewer displays it; transparency is ignored.

    Parameters
    ----------
    page : int, optional
        Time point, slice or page of a file with several, from 1.
    channel : str, optional
        Channel used as brightness: red, green, blue, saturation or hue; luminance by default.

    Raises
    ------
    RaptorError
        If the file is missing, not an image, too small or of one value, if none of several pages is chosen,
        or if the channel is unknown or the picture is grey.
    """
    colours = read_pixels(path, "image", page).colours
    if min(colours.shape[:2]) < SMALLEST_SIDE:
        rows, columns = colours.shape[:2]
        raise RaptorError(f"image {path} is {columns} x {rows} pixels; at least {SMALLEST_SIDE} are needed")
    return as_picture(channel_of(colours, channel, f"image {path}"), f"image {path}")


def channel_of(colours: NDArray[np.float64], channel: str | None, name: str) -> NDArray[np.float64]:
    """One value per pixel (row, column) from colours (row, column, 1 or 3); None is luminance.

    Raises
    ------
    RaptorError
        If the channel is unknown, or the colours are grey.
    """
    if channel is not None and channel not in CHANNELS:
        raise RaptorError(f"channel is {channel}; allowed are {', '.join(CHANNELS)}")
    grey = colours.shape[-1] == 1 or bool((np.ptp(colours, axis=-1) == 0).all())
    if channel is None:
        return colours[..., 0] if colours.shape[-1] == 1 else np.asarray(color.rgb2gray(colours))
    if grey:
        raise RaptorError(f"{name} is grey, so it has no channel {channel}; drop --channel")
    return np.asarray(CHANNELS[channel](colours), dtype=np.float64)


def hue(colours: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colour (row, column) without lightness, 0.5 to 1, along the direction in which the colours differ.

    Hue is an angle, undefined for black and grey. In the plane of a* and b* (CIE 1976) two hues are two
    points, and the principal axis of all pixels connects them.
    """
    plane = color.rgb2lab(colours)[..., 1:]
    plane -= plane.mean(axis=(0, 1))
    _, axes = np.linalg.eigh(np.einsum("yxa,yxb->ab", plane, plane))
    along = plane @ axes[:, -1]
    low, high = np.percentile(along, (0.1, 99.9))
    return np.asarray(0.5 + 0.5 * np.clip((along - low) / max(high - low, 1e-9), 0, 1))


CHANNELS: dict[str, Callable[[NDArray[np.float64]], NDArray[np.float64]]] = {
    "red": lambda colours: colours[..., 0],
    "green": lambda colours: colours[..., 1],
    "blue": lambda colours: colours[..., 2],
    "saturation": lambda colours: np.asarray(color.rgb2hsv(colours)[..., 1]),
    "hue": hue,
}
"""Channels that can replace brightness for a tissue distinguished by its colour."""


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
