"""The frame: the square image that contains every mould, and its pixel grid. Lengths in l0."""

import numpy as np
from numpy.typing import NDArray

IMAGE_SIZE = 62.5
"""Side of the square image, l0; its centre is the origin (paper: 256 pixels of 125/512 l0)."""


def pixel_size(pixels: int) -> float:
    """Side of a pixel, l0."""
    return IMAGE_SIZE / pixels


def pixel_centres(pixels: int) -> NDArray[np.float64]:
    """Coordinates of pixel centres along one axis, ascending, (pixels,), l0."""
    return np.asarray((np.arange(pixels) - (pixels - 1) / 2) * pixel_size(pixels))
