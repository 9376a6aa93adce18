"""A compact U-Net: parameters enter by feature-wise modulation, outputs obey the physics by construction.

Squares of 2 x 2 pixels become channels, residual blocks of 3 x 3 convolutions work at four resolutions,
and channels become squares again. The three parameters scale and shift every normalised channel (E. Perez
et al., FiLM, 2018, arXiv:1709.07871) in place of constant images.
"""

from itertools import pairwise

from torch import Tensor, nn
from torch.nn.functional import interpolate, pixel_shuffle, pixel_unshuffle, silu

from raptor.symmetry import FIELDS

WIDTHS = (1, 2, 3, 4)  # of the resolutions, in base channels
MASKS, PARAMETERS = 2, 3  # of the inputs: images, then constants
EMBEDDED = 64
SQUARE = 2  # side, in pixels, of what becomes channels


class ParameterEmbedding(nn.Module):
    """What networks are modulated by, (n, EMBEDDED), from scaled inputs (n, 5, y, x)."""

    def __init__(self) -> None:
        super().__init__()
        inner, outer = nn.Linear(PARAMETERS, EMBEDDED), nn.Linear(EMBEDDED, EMBEDDED)
        self.layers = nn.Sequential(inner, nn.SiLU(), outer, nn.SiLU())

    def forward(self, inputs: Tensor) -> Tensor:
        """The constant images of the parameters are read at one pixel."""
        embedded: Tensor = self.layers(inputs[:, MASKS:, 0, 0])
        return embedded


class ModulatedNorm(nn.Module):
    """Batch normalisation, then modulation: y = (1 + scale) norm(x) + shift."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.norm = nn.BatchNorm2d(channels)
        self.modulation = nn.Linear(EMBEDDED, 2 * channels)
        nn.init.zeros_(self.modulation.weight)
        nn.init.zeros_(self.modulation.bias)

    def forward(self, features: Tensor, embedded: Tensor) -> Tensor:
        """Features (n, channels, y, x), modulated by what is embedded (n, EMBEDDED)."""
        scale, shift = self.modulation(embedded)[:, :, None, None].chunk(2, dim=1)
        modulated: Tensor = self.norm(features) * (1 + scale) + shift
        return modulated


class _Modulated(nn.Module):
    """Convolution and modulated normalisation."""

    def __init__(self, before: int, after: int, stride: int = 1) -> None:
        super().__init__()
        self.convolution = nn.Conv2d(before, after, 3, stride=stride, padding=1, bias=False)
        self.norm = ModulatedNorm(after)

    def forward(self, features: Tensor, embedded: Tensor) -> Tensor:
        modulated: Tensor = self.norm(self.convolution(features), embedded)
        return modulated


class _Residual(nn.Module):
    """Two modulated convolutions beside the identity."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = _Modulated(channels, channels)
        self.second = _Modulated(channels, channels)

    def forward(self, features: Tensor, embedded: Tensor) -> Tensor:
        inner = silu(self.first(features, embedded))
        added: Tensor = features + self.second(inner, embedded)
        return silu(added)


class CompactUNet(nn.Module):
    """From inputs (n, 5, y, x), scaled, to eight free channels (n, 8, y, x) for `PhysicalFields`."""

    def __init__(self, base_channels: int) -> None:
        super().__init__()
        widths = [base_channels * width for width in WIDTHS]
        self.embed = ParameterEmbedding()
        self.open = _Modulated(MASKS * SQUARE**2, widths[0])
        self.down = nn.ModuleList(_Modulated(a, b, stride=2) for a, b in pairwise(widths))
        self.inner = nn.ModuleList(_Residual(width) for width in widths)
        self.up = nn.ModuleList(_Modulated(b, a) for a, b in pairwise(widths))
        self.outer = nn.ModuleList(_Residual(width) for width in widths[:-1])
        self.close = nn.Conv2d(widths[0], len(FIELDS) * SQUARE**2, 3, padding=1)
        nn.init.normal_(self.close.weight, 0.0, 0.01)

    def forward(self, inputs: Tensor) -> Tensor:
        """Free channels."""
        embedded = self.embed(inputs)
        features = silu(self.open(pixel_unshuffle(inputs[:, :MASKS], SQUARE), embedded))
        skips = []
        for level, residual in enumerate(self.inner):
            features = residual(features, embedded)
            if level < len(self.down):
                skips.append(features)
                features = silu(self.down[level](features, embedded))
        for level in reversed(range(len(self.up))):
            wide = interpolate(features, scale_factor=2.0, mode="nearest")
            features = silu(self.up[level](wide, embedded) + skips[level])
            features = self.outer[level](features, embedded)
        free: Tensor = pixel_shuffle(self.close(features), SQUARE)
        return free
