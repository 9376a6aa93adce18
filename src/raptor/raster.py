"""From cells to pixels: the eight fields of the paper's section "Machine Learning".

Z_p = sum over cells of z_i w_ip, where w_ip is a Gaussian around cell i integrated over pixel p.
Sigma is a length, 3 x 125/512 l0, the same at every raster. Images are (y, x), rows ascending.
"""

import math

import numpy as np
from numpy.typing import NDArray

from raptor.core.compiled import kernel
from raptor.core.errors import RaptorError
from raptor.frame import IMAGE_SIZE, pixel_size

SIGMA = 3 * 125 / 512
"""Width of the Gaussian, l0 (3 pixels of the paper's 256-pixel image)."""

DEEP = 5 * SIGMA
"""Largest depth of density in a wall, l0."""

REACH = 6.0  # in sigma; 2e-9 of a cell lies beyond


@kernel
def _weights_kernel(position, pixels, size, weights):
    """Integrals of a one-dimensional Gaussian over pixels; returns the first pixel and how many."""
    scale = 1.0 / (SIGMA * math.sqrt(2.0))
    edge = -0.5 * IMAGE_SIZE
    first = max(0, math.floor((position - REACH * SIGMA - edge) / size))
    last = min(pixels - 1, math.floor((position + REACH * SIGMA - edge) / size))
    below = math.erf((edge + first * size - position) * scale)
    for pixel in range(first, last + 1):
        above = math.erf((edge + (pixel + 1) * size - position) * scale)
        weights[pixel - first] = 0.5 * (above - below)
        below = above
    return first, max(0, last - first + 1)


@kernel
def _rasterise_kernel(x, y, values, size, image):
    """Add every cell's channels (cells, channels) to the image (channels, pixels, pixels)."""
    channels, pixels, _ = image.shape
    wx = np.empty(pixels)
    wy = np.empty(pixels)
    for i in range(x.size):
        x0, nx = _weights_kernel(x[i], pixels, size, wx)
        y0, ny = _weights_kernel(y[i], pixels, size, wy)
        for channel in range(channels):
            value = values[i, channel]
            for row in range(ny):
                weight = value * wy[row]
                for column in range(nx):
                    image[channel, y0 + row, x0 + column] += weight * wx[column]


def channels_of(orientation: NDArray[np.float64], tension: NDArray[np.float64]) -> NDArray[np.float64]:
    """Each cell's eight channels (cells, 8), in the order `FIELDS`.

    Parameters
    ----------
    orientation : ndarray (cells, 3)
        Unit vectors.
    tension : ndarray (cells,)
        Mean tension of each cell's bonds, kappa0 l0.
    """
    sx, sy, sz = orientation.T
    products = (sx * sx, sy * sy, sz * sz, sx * sy, sx * sz, sy * sz)
    return np.column_stack([np.ones(len(tension)), tension, *products])


def rasterise(
    positions: NDArray[np.float64],
    orientation: NDArray[np.float64],
    tension: NDArray[np.float64],
    pixels: int,
) -> NDArray[np.float64]:
    """The eight fields (8, pixels, pixels) of a tissue, per pixel.

    Parameters
    ----------
    positions : ndarray (cells, 2 or 3)
        x, y (and z, ignored), l0.
    orientation : ndarray (cells, 3)
        Unit vectors.
    tension : ndarray (cells,)
        kappa0 l0.

    Raises
    ------
    RaptorError
        If the arrays disagree in length.
    """
    if not len(positions) == len(orientation) == len(tension):
        raise RaptorError(
            f"{len(positions)} positions, {len(orientation)} orientations and {len(tension)} "
            "tensions given; give one of each per cell"
        )
    return _image(positions, channels_of(orientation, tension), pixels)


def density_image(positions: NDArray[np.float64], pixels: int) -> NDArray[np.float64]:
    """Density per pixel (pixels, pixels) of cells at positions (cells, 2 or 3), l0."""
    return np.asarray(_image(positions, np.ones((len(positions), 1)), pixels)[0])


def _image(positions: NDArray[np.float64], values: NDArray[np.float64], pixels: int) -> NDArray[np.float64]:
    """Sums (channels, pixels, pixels) over cells of their values (cells, channels), blurred."""
    image = np.zeros((values.shape[1], pixels, pixels))
    x, y = (np.ascontiguousarray(positions[:, axis]) for axis in (0, 1))
    _rasterise_kernel(x, y, values, pixel_size(pixels), image)
    return image


def density_threshold(layers: int, pixels: int) -> float:
    """Density per pixel above which there is tissue: 0.2 at 7 layers and 256 pixels (paper)."""
    return 0.48 * layers * pixel_size(pixels) ** 2
