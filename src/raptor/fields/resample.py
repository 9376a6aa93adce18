"""Block averages of images, and full resolution recovered from them by Fourier deconvolution.

Fields are smooth over sigma = 0.732 l0, so block averages 0.98 l0 wide lose little, and half as wide ones
nothing (docs/surrogate.md). For numpy arrays and torch tensors.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from raptor.core.arrays import Array, library_of
from raptor.moulds.cast import CastMould


def block_average(images: Array, pixels: int) -> Array:
    """Images (..., y, x) as means over squares of pixels, (..., pixels, pixels)."""
    ratio = images.shape[-1] // pixels
    if ratio == 1:
        return images
    squares = images.reshape(*images.shape[:-2], pixels, ratio, pixels, ratio)
    return squares.mean((-3, -1))  # type: ignore[no-any-return]


def coarse_images(cast: CastMould, pixels: int) -> NDArray[np.float32]:
    """What networks see of a mould (3, pixels, pixels): block averages of depression, tethers and density.

    The density is that as cast, over the density far from walls. It tells how the lattice meets the walls,
    which accounts for two fifths of what seems noise otherwise (docs/surrogate.md).
    """
    images: NDArray[np.float32] = block_average(
        np.stack([cast.depression, cast.tethers, cast.relative_density]).astype(np.float32), pixels
    )
    return images


def deconvolve(images: Array, pixels: int) -> Array:
    """Images (..., pixels, pixels), smooth and zero at the border, from their block averages.

    Wave numbers that the block averages do not resolve are taken to be absent.
    """
    coarse = images.shape[-1]
    if coarse == pixels:
        return images
    along = deconvolution(coarse, pixels)
    along = library_of(images).asarray(along, dtype=images.dtype, device=images.device)
    return along @ images @ along.T  # type: ignore[no-any-return]


@cache
def deconvolution(coarse: int, pixels: int) -> NDArray[np.float64]:
    """The matrix (pixels, coarse) that recovers one axis: Fourier modes over the transfer function."""
    ratio = pixels // coarse
    waves = np.arange(1 - coarse // 2, coarse // 2)[:, None]  # periods an image
    offsets = np.arange(ratio)
    transfer = np.exp(2j * np.pi * waves * offsets / pixels).mean(axis=1, keepdims=True)
    analysis = np.exp(-2j * np.pi * waves * np.arange(coarse) / coarse) / coarse
    synthesis = np.exp(2j * np.pi * waves * np.arange(pixels) / pixels)
    return np.asarray((synthesis.T @ (analysis / transfer)).real)
