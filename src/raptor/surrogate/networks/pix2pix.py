"""pix2pix (Isola et al. 2017, arXiv:1611.07004): a U-Net and a PatchGAN discriminator."""

import math

import torch
from torch import Tensor, nn

from raptor.dataset.scaling import INPUTS
from raptor.surrogate.networks.blocks import IMAGES, FilmNorm, ParameterEmbedding
from raptor.surrogate.rules import Architecture
from raptor.symmetry import FIELDS

DROPOUT = 0.5
"""Dropout in the three deepest decoder layers."""

WIDEST = 8
"""Channels of the deepest layers, over those of the first."""


def build(architecture: Architecture) -> nn.Module:
    """The published U-Net."""
    return UNet(architecture.pixels, architecture.base_channels)


def build_film(architecture: Architecture) -> nn.Module:
    """The same, with parameters that scale and shift its features."""
    embed = ParameterEmbedding(architecture.noise)
    return UNet(architecture.pixels, architecture.base_channels, embed)


class Down(nn.Sequential):
    """Halve the image: strided convolution and optional normalisation."""

    def __init__(
        self, before: int, after: int, *, normalise: bool, activate: bool = True, film: bool = False
    ) -> None:
        layers: list[nn.Module] = [nn.LeakyReLU(0.2)] if activate else []
        layers.append(nn.Conv2d(before, after, 4, stride=2, padding=1, bias=not normalise))
        if normalise:
            layers.append(FilmNorm(after) if film else nn.BatchNorm2d(after))
        super().__init__(*layers)


class Up(nn.Sequential):
    """Double the image: transposed convolution, normalisation, dropout in the deepest layers."""

    def __init__(self, before: int, after: int, *, dropout: float, film: bool = False) -> None:
        layers: list[nn.Module] = [
            nn.ReLU(),
            nn.ConvTranspose2d(before, after, 4, stride=2, padding=1, bias=False),
            FilmNorm(after) if film else nn.BatchNorm2d(after),
        ]
        if dropout > 0:
            layers.append(nn.Dropout(dropout))
        super().__init__(*layers)


class UNet(nn.Module):
    """A U-Net with skip connections, from inputs (n, 6, y, x) to fields (n, 8, y, x), both scaled.

    With an embedding, parameters modulate its features and its first layer sees only the images.
    """

    def __init__(self, pixels: int, base_channels: int, embed: ParameterEmbedding | None = None) -> None:
        super().__init__()
        film = embed is not None
        depth = int(math.log2(pixels))
        channels = [base_channels * min(2**level, WIDEST) for level in range(depth)]
        self.embed = embed
        self.inputs = IMAGES if film else len(INPUTS)
        self.down = nn.ModuleList()
        for level, (before, after) in enumerate(zip([self.inputs, *channels[:-1]], channels, strict=True)):
            inner = 0 < level < depth - 1
            self.down.append(Down(before, after, normalise=inner, activate=level > 0, film=film))
        self.up = nn.ModuleList()
        for level in range(depth - 1, 0, -1):
            before = channels[level] * (1 if level == depth - 1 else 2)
            dropout = DROPOUT if level >= depth - 3 else 0.0
            self.up.append(Up(before, channels[level - 1], dropout=dropout, film=film))
        self.last = nn.Sequential(
            nn.ReLU(), nn.ConvTranspose2d(2 * channels[0], len(FIELDS), 4, stride=2, padding=1)
        )
        initialise(self)

    def forward(self, inputs: Tensor, noise: Tensor | None = None) -> Tensor:
        """Scaled fields. The last layer is linear: fields of new moulds may exceed 1."""
        embedding = None if self.embed is None else self.embed(inputs, noise)
        skips = []
        features = inputs[:, : self.inputs]
        for down in self.down:
            features = _through(down, features, embedding)
            skips.append(features)
        features = skips.pop()
        for up in self.up:
            features = torch.cat([_through(up, features, embedding), skips.pop()], dim=1)
        return self.last(features)  # type: ignore[no-any-return]


class Discriminator(nn.Module):
    """PatchGAN: classifies fields as simulated or predicted, patch by patch, given their inputs."""

    def __init__(self, pixels: int, base_channels: int) -> None:
        super().__init__()
        strided = strided_layers(pixels)
        channels = [base_channels * min(2**level, WIDEST) for level in range(strided + 1)]
        layers: list[nn.Module] = []
        for level, before in enumerate([len(INPUTS) + len(FIELDS), *channels[: strided - 1]]):
            layers.append(Down(before, channels[level], normalise=level > 0, activate=level > 0))
        layers += [
            nn.LeakyReLU(0.2),
            nn.Conv2d(channels[strided - 1], channels[strided], 4, padding=1, bias=False),
            nn.BatchNorm2d(channels[strided]),
            nn.LeakyReLU(0.2),
            nn.Conv2d(channels[strided], 1, 4, padding=1),
        ]
        self.layers = nn.Sequential(*layers)
        initialise(self)

    def forward(self, inputs: Tensor, fields: Tensor) -> Tensor:
        """Logits (n, 1, y', x') that fields (n, 8, y, x) were simulated, of inputs (n, 6, y, x)."""
        return self.layers(torch.cat([inputs, fields], dim=1))  # type: ignore[no-any-return]


def strided_layers(pixels: int) -> int:
    """Strided layers of a discriminator whose patches cover the published share of the image.

    3 on 256 pixels or more, where patches are 70 pixels wide; 1 on 64 or fewer, where they are 16.
    """
    return min(max(int(math.log2(pixels)) - 5, 1), 3)


def initialise(network: nn.Module) -> None:
    """Draw weights from N(0, 0.02), as published."""
    for module in network.modules():
        if isinstance(module, nn.Conv2d | nn.ConvTranspose2d):
            nn.init.normal_(module.weight, 0.0, 0.02)
            if module.bias is not None:
                nn.init.zeros_(module.bias)
        elif isinstance(module, nn.BatchNorm2d):
            nn.init.normal_(module.weight, 1.0, 0.02)
            nn.init.zeros_(module.bias)


def _through(layers: nn.Module, features: Tensor, embedding: Tensor | None) -> Tensor:
    """Features after layers, some of which are modulated."""
    for layer in layers.children():
        features = layer(features, embedding) if isinstance(layer, FilmNorm) else layer(features)
    return features
