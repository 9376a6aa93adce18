"""From fine images to coarse ones, and back without loss.

Fields are smooth over sigma = 0.732 l0, so an image of 128 pixels (0.488 l0 each) holds all that one of 256
does: what is coarser is a mean over pixels, and what is finer is found again in Fourier's series, each
wave divided by what the mean has left of it. A network need not work on more pixels than that.
"""

import math

import torch
from torch import Tensor


def pooled(images: Tensor, pixels: int) -> Tensor:
    """Images (..., y, x) as means over squares of pixels, (..., pixels, pixels)."""
    ratio = images.shape[-1] // pixels
    if ratio == 1:
        return images
    squares = images.reshape(*images.shape[:-2], pixels, ratio, pixels, ratio)
    return squares.mean(dim=(-3, -1))


def refined(images: Tensor, pixels: int) -> Tensor:
    """The images (..., pixels, pixels), smooth and zero at the rim, whose means over squares are given.

    Waves that the coarse image cannot hold are taken to be absent.
    """
    coarse = images.shape[-1]
    ratio = pixels // coarse
    if ratio == 1:
        return images
    waves = torch.fft.rfft2(images)
    half = coarse // 2
    fine = waves.new_zeros((*images.shape[:-2], pixels, pixels // 2 + 1))
    rows, columns = (torch.fft.fftfreq(pixels), torch.fft.rfftfreq(pixels))
    left = _left_of_wave(rows, ratio)[:, None] * _left_of_wave(columns, ratio)
    left = left.to(images.device)
    fine[..., :half, :half] = waves[..., :half, :half] / left[:half, :half]
    fine[..., -half + 1 :, :half] = waves[..., -half + 1 :, :half] / left[-half + 1 :, :half]
    again: Tensor = torch.fft.irfft2(fine * ratio**2, s=(pixels, pixels))
    return again


def _left_of_wave(frequency: Tensor, ratio: int) -> Tensor:
    """What a mean over `ratio` pixels leaves of waves of so many periods a pixel, its shift included."""
    offset = torch.arange(ratio)
    return torch.exp(2j * math.pi * frequency[:, None] * offset).mean(1)
