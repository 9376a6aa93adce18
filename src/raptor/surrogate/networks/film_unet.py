"""A residual U-Net, modulated by the parameters.

Squares of 2 x 2 pixels become channels, residual blocks of 3 x 3 convolutions act at four resolutions, and
channels become squares again.
"""

from itertools import pairwise

from torch import Tensor, nn
from torch.nn.functional import interpolate, pixel_shuffle, pixel_unshuffle, silu

from raptor.surrogate.networks.blocks import IMAGES, FilmNorm, ParameterEmbedding
from raptor.surrogate.rules import Architecture
from raptor.symmetry import FIELDS

WIDTHS = (1, 2, 3, 4)
"""Channels at each resolution, over those of the first."""

SQUARE = 2
"""Side, in pixels, of the squares that become channels."""


def build(architecture: Architecture) -> nn.Module:
    """The network of an architecture."""
    return FilmUNet(architecture.base_channels, architecture.noise)


class FilmConvolution(nn.Module):
    """A 3 x 3 convolution and modulated normalisation."""

    def __init__(self, before: int, after: int, stride: int = 1) -> None:
        super().__init__()
        self.convolution = nn.Conv2d(before, after, 3, stride=stride, padding=1, bias=False)
        self.norm = FilmNorm(after)

    def forward(self, features: Tensor, embedding: Tensor) -> Tensor:
        """Features (n, after, y, x) from (n, before, y, x)."""
        modulated: Tensor = self.norm(self.convolution(features), embedding)
        return modulated


class ResidualBlock(nn.Module):
    """Two modulated convolutions beside the identity."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = FilmConvolution(channels, channels)
        self.second = FilmConvolution(channels, channels)

    def forward(self, features: Tensor, embedding: Tensor) -> Tensor:
        """Features of the same shape."""
        inner = silu(self.first(features, embedding))
        added: Tensor = features + self.second(inner, embedding)
        return silu(added)


class FilmUNet(nn.Module):
    """From scaled inputs (n, 6, y, x) to eight free channels (n, 8, y, x) for `PhysicalFields`."""

    def __init__(self, base_channels: int, noise: int = 0) -> None:
        super().__init__()
        widths = [base_channels * width for width in WIDTHS]
        self.embed = ParameterEmbedding(noise)
        self.stem = FilmConvolution(IMAGES * SQUARE**2, widths[0])
        self.encoder = nn.ModuleList(ResidualBlock(width) for width in widths)
        self.down = nn.ModuleList(FilmConvolution(a, b, stride=2) for a, b in pairwise(widths))
        self.up = nn.ModuleList(FilmConvolution(b, a) for a, b in pairwise(widths))
        self.decoder = nn.ModuleList(ResidualBlock(width) for width in widths[:-1])
        self.head = nn.Conv2d(widths[0], len(FIELDS) * SQUARE**2, 3, padding=1)
        nn.init.normal_(self.head.weight, 0.0, 0.01)

    def forward(self, inputs: Tensor, noise: Tensor | None = None) -> Tensor:
        """Free channels; one sample if there is noise (n, numbers)."""
        embedding = self.embed(inputs, noise)
        features = silu(self.stem(pixel_unshuffle(inputs[:, :IMAGES], SQUARE), embedding))
        skips = []
        for level, residual in enumerate(self.encoder):
            features = residual(features, embedding)
            if level < len(self.down):
                skips.append(features)
                features = silu(self.down[level](features, embedding))
        for level in reversed(range(len(self.up))):
            wide = interpolate(features, scale_factor=2.0, mode="nearest")
            features = silu(self.up[level](wide, embedding) + skips[level])
            features = self.decoder[level](features, embedding)
        free: Tensor = pixel_shuffle(self.head(features), SQUARE)
        return free
