"""Networks: pix2pix (Isola et al. 2017, arXiv:1611.07004) and what stands in its generator's place."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from types import MethodType
from typing import Any

import torch
from torch import Tensor, nn

from raptor.core.errors import RaptorError
from raptor.dataset.scaling import INPUTS, Scaling
from raptor.surrogate.constraints import PhysicalFields
from raptor.surrogate.film_unet import MASKS, CompactUNet, ModulatedNorm, ParameterEmbedding
from raptor.symmetry import FIELDS

NETWORKS = ("pix2pix", "modulated", "compact", "fno")
PHYSICAL = ("compact", "fno")  # obey the physics by construction; the others are projected
ENOUGH = 64  # pixels that show fields without loss to speak of (docs/surrogate.md)
MODES = 12  # Fourier modes that a neural operator keeps along each axis


@dataclass(frozen=True)
class Architecture:
    """Sizes of the networks.

    Parameters
    ----------
    pixels : int
        Side of the images, a power of two from 16 to 1024.
    base_channels : int
        Channels of the first layer (64 in pix2pix); deeper layers have up to 8 times as many.
    dropout : float
        In the three deepest decoder layers (0.5 in pix2pix).
    patch_layers : int
        Strided layers of the discriminator, fewer on images below 32 pixels: 3 see patches of 70 x
        70 pixels.
    network : str
        "pix2pix", the published U-Net; "modulated", the same with parameters that scale and shift its
        features; "compact", a residual U-Net, or "fno", a Fourier neural operator, whose outputs obey the
        physics by construction.
    """

    pixels: int
    base_channels: int
    dropout: float = 0.5
    patch_layers: int = 3
    network: str = "pix2pix"

    def __post_init__(self) -> None:
        if not (16 <= self.pixels <= 1024 and self.pixels & (self.pixels - 1) == 0):
            raise RaptorError(f"pixels is {self.pixels}; a power of two from 16 to 1024 is needed")
        if self.network not in NETWORKS:
            raise RaptorError(f"network is '{self.network}'; allowed are {', '.join(NETWORKS)}")

    def as_json(self) -> dict[str, Any]:
        """As it stands in model.json."""
        return asdict(self)


def architecture_of(settings: Mapping[str, Any], pixels: int) -> Architecture:
    """The architecture that a configuration's block `surrogate` asks for, of images of so many pixels."""
    names = ("base_channels", "dropout", "patch_layers", "network")
    seen = settings["pixels"] or min(ENOUGH, pixels)
    return Architecture(seen, **{name: settings[name] for name in names})


class _Down(nn.Sequential):
    """Halve the image: strided convolution, normalisation where there is something to average."""

    def __init__(
        self, before: int, after: int, normalise: bool, activate: bool = True, modulated: bool = False
    ) -> None:
        layers: list[nn.Module] = [nn.LeakyReLU(0.2)] if activate else []
        layers.append(nn.Conv2d(before, after, 4, stride=2, padding=1, bias=not normalise))
        if normalise:
            layers.append(ModulatedNorm(after) if modulated else nn.BatchNorm2d(after))
        super().__init__(*layers)


class _Up(nn.Sequential):
    """Double the image: transposed convolution, normalisation, dropout in the deepest layers."""

    def __init__(self, before: int, after: int, dropout: float, modulated: bool = False) -> None:
        layers: list[nn.Module] = [
            nn.ReLU(),
            nn.ConvTranspose2d(before, after, 4, stride=2, padding=1, bias=False),
            ModulatedNorm(after) if modulated else nn.BatchNorm2d(after),
        ]
        if dropout > 0:
            layers.append(nn.Dropout(dropout))
        super().__init__(*layers)


def _through(layers: nn.Module, features: Tensor, embedded: Tensor | None) -> Tensor:
    """Features after layers, of which some are modulated."""
    for layer in layers.children():
        features = layer(features, embedded) if isinstance(layer, ModulatedNorm) else layer(features)
    return features


class Generator(nn.Module):
    """From scaled inputs to scaled fields, by the architecture's network; physical where that is."""

    def __init__(self, architecture: Architecture, scaling: Scaling) -> None:
        super().__init__()
        self.network = _network(architecture)
        self.physical = PhysicalFields(scaling) if architecture.network in PHYSICAL else None

    def forward(self, inputs: Tensor, cells: Tensor) -> Tensor:
        """Fields (n, 8, y, x) of inputs (n, 5, y, x) and numbers of cells (n,)."""
        found: Tensor = self.network(inputs)
        if self.physical is None:
            return found
        fields: Tensor = self.physical(found.float(), 0.5 * (inputs[:, :1] + 1), cells)
        return fields


def _network(architecture: Architecture) -> nn.Module:
    """From scaled inputs (n, 5, y, x) to eight channels (n, 8, y, x)."""
    if architecture.network == "compact":
        return CompactUNet(architecture.base_channels)
    if architecture.network == "fno":
        from neuralop.models import FNO  # here: other networks need not wait for it

        modes = min(MODES, architecture.pixels // 2)
        operator: nn.Module = FNO(
            n_modes=(modes, modes),
            in_channels=len(INPUTS),
            out_channels=len(FIELDS),
            hidden_channels=architecture.base_channels,
        )
        # The library's own adds what is no tensor, which neither checkpoints nor safetensors take.
        operator.state_dict = MethodType(nn.Module.state_dict, operator)  # type: ignore[method-assign]
        return operator
    return UNet(architecture)


class UNet(nn.Module):
    """pix2pix' U-Net with skip connections, from inputs (n, 5, y, x) to fields (n, 8, y, x), both scaled.

    Where it is modulated, parameters scale and shift its normalised features, and the network sees the
    masks alone.
    """

    def __init__(self, architecture: Architecture) -> None:
        super().__init__()
        depth = int(math.log2(architecture.pixels))
        channels = [architecture.base_channels * min(2**level, 8) for level in range(depth)]
        modulated = architecture.network == "modulated"
        self.embed = ParameterEmbedding() if modulated else None
        self.seen = MASKS if modulated else len(INPUTS)
        self.down = nn.ModuleList()
        for level, after in enumerate(channels):
            before = channels[level - 1] if level else self.seen
            inner = 0 < level < depth - 1
            self.down.append(_Down(before, after, normalise=inner, activate=level > 0, modulated=modulated))
        self.up = nn.ModuleList()
        for level in range(depth - 1, 0, -1):
            before = channels[level] * (1 if level == depth - 1 else 2)
            dropout = architecture.dropout if level >= depth - 3 else 0.0
            self.up.append(_Up(before, channels[level - 1], dropout, modulated))
        self.last = nn.Sequential(
            nn.ReLU(), nn.ConvTranspose2d(2 * channels[0], len(FIELDS), 4, stride=2, padding=1)
        )

    def forward(self, inputs: Tensor) -> Tensor:
        """Predict scaled fields. The last layer is linear: fields of new moulds may exceed 1."""
        embedded = None if self.embed is None else self.embed(inputs)
        skips = []
        features = inputs[:, : self.seen]
        for down in self.down:
            features = _through(down, features, embedded)
            skips.append(features)
        features = skips.pop()
        for up in self.up:
            features = torch.cat([_through(up, features, embedded), skips.pop()], dim=1)
        return self.last(features)  # type: ignore[no-any-return]


class Discriminator(nn.Module):
    """PatchGAN: judges each patch of inputs and fields together; returns logits (n, 1, y', x')."""

    def __init__(self, architecture: Architecture) -> None:
        super().__init__()
        base = architecture.base_channels
        before = len(INPUTS) + len(FIELDS)
        layers: list[nn.Module] = []
        strided = min(architecture.patch_layers, int(math.log2(architecture.pixels)) - 2)
        for level in range(strided):
            after = base * min(2**level, 8)
            layers.append(_Down(before, after, normalise=level > 0, activate=level > 0))
            before = after
        after = base * min(2**strided, 8)
        layers += [
            nn.LeakyReLU(0.2),
            nn.Conv2d(before, after, 4, padding=1, bias=False),
            nn.BatchNorm2d(after),
            nn.LeakyReLU(0.2),
            nn.Conv2d(after, 1, 4, padding=1),
        ]
        self.layers = nn.Sequential(*layers)

    def forward(self, inputs: Tensor, fields: Tensor) -> Tensor:
        """Logits of "these fields belong to these inputs", patch by patch."""
        return self.layers(torch.cat([inputs, fields], dim=1))  # type: ignore[no-any-return]


def initialise(network: nn.Module) -> nn.Module:
    """Weights from N(0, 0.02), as published for pix2pix."""
    for module in network.modules():
        if isinstance(module, nn.Conv2d | nn.ConvTranspose2d):
            nn.init.normal_(module.weight, 0.0, 0.02)
            if module.bias is not None:
                nn.init.zeros_(module.bias)
        elif isinstance(module, nn.BatchNorm2d):
            nn.init.normal_(module.weight, 1.0, 0.02)
            nn.init.zeros_(module.bias)
    return network
