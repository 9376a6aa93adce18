"""From cells to pixels on a GPU: the fields of `raptor.raster` as products of matrices.

The weight of a cell on a pixel is a product of one along x and one along y, so a field is
(weights along y)^T diag(z) (weights along x), work that suits a GPU. Never yet measured on one.
"""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from raptor.frame import IMAGE_SIZE, pixel_size
from raptor.raster import SIGMA, channels_of


def _weights(position: Tensor, pixels: int) -> Tensor:
    """Integrals (cells, pixels) of Gaussians at positions (cells,) over pixels."""
    edges = torch.arange(pixels + 1, device=position.device) * pixel_size(pixels) - 0.5 * IMAGE_SIZE
    below = torch.erf((edges - position[:, None]) / (SIGMA * 2.0**0.5))
    return (0.5 * below.diff(dim=1)).clamp(min=0.0)


def rasterise(
    positions: NDArray[np.float64],
    orientation: NDArray[np.float64],
    tension: NDArray[np.float64],
    pixels: int,
    device: torch.device,
) -> NDArray[np.float32]:
    """The eight fields (8, pixels, pixels), as `raptor.raster.rasterise`, in single precision."""
    channels = torch.tensor(channels_of(orientation, tension), dtype=torch.float32, device=device)
    x, y = (torch.tensor(positions[:, axis], dtype=torch.float32, device=device) for axis in (0, 1))
    along = channels[:, :, None] * _weights(x, pixels)[:, None]
    image = _weights(y, pixels).T @ along.reshape(len(x), -1)
    fields = image.reshape(pixels, channels.shape[1], pixels).movedim(1, 0)
    return np.ascontiguousarray(fields.cpu().numpy())
