"""A compact U-Net: parameters enter by feature-wise modulation, outputs obey the physics by construction.

Residual blocks of 3 x 3 convolutions at five resolutions. The three parameters scale and shift every
normalised channel (E. Perez et al., FiLM, 2018, arXiv:1709.07871) in place of constant images.
"""

from itertools import pairwise

from torch import Tensor, nn
from torch.nn.functional import silu

from raptor.symmetry import FIELDS

WIDTHS = (1, 2, 4, 6, 6)  # of the resolutions, in base channels
MASKS, PARAMETERS = 2, 3  # of the inputs: images, then constants
EMBEDDED = 64


class _Modulated(nn.Module):
    """Convolution, normalisation, modulation: y = (1 + scale) norm(conv(x)) + shift."""

    def __init__(self, before: int, after: int, stride: int = 1) -> None:
        super().__init__()
        self.convolution = nn.Conv2d(before, after, 3, stride=stride, padding=1, bias=False)
        self.norm = nn.BatchNorm2d(after)
        self.modulation = nn.Linear(EMBEDDED, 2 * after)
        nn.init.zeros_(self.modulation.weight)
        nn.init.zeros_(self.modulation.bias)

    def forward(self, features: Tensor, embedded: Tensor) -> Tensor:
        scale, shift = self.modulation(embedded)[:, :, None, None].chunk(2, dim=1)
        normal: Tensor = self.norm(self.convolution(features))
        modulated: Tensor = normal * (1 + scale) + shift
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
        self.embed = nn.Sequential(
            nn.Linear(PARAMETERS, EMBEDDED), nn.SiLU(), nn.Linear(EMBEDDED, EMBEDDED), nn.SiLU()
        )
        self.open = _Modulated(MASKS, widths[0])
        self.down = nn.ModuleList(_Modulated(a, b, stride=2) for a, b in pairwise(widths))
        self.inner = nn.ModuleList(_Residual(width) for width in widths)
        self.up = nn.ModuleList(_Modulated(b, a) for a, b in pairwise(widths))
        self.outer = nn.ModuleList(_Residual(width) for width in widths[:-1])
        self.close = nn.Conv2d(widths[0], len(FIELDS), 1)
        nn.init.normal_(self.close.weight, 0.0, 0.02)

    def forward(self, inputs: Tensor) -> Tensor:
        """Free channels; the constant images of the parameters are read at one pixel."""
        embedded = self.embed(inputs[:, MASKS:, 0, 0])
        features = silu(self.open(inputs[:, :MASKS], embedded))
        skips = []
        for level, residual in enumerate(self.inner):
            features = residual(features, embedded)
            if level < len(self.down):
                skips.append(features)
                features = silu(self.down[level](features, embedded))
        for level in reversed(range(len(self.up))):
            wide = nn.functional.interpolate(features, scale_factor=2.0, mode="nearest")
            features = silu(self.up[level](wide, embedded) + skips[level])
            features = self.outer[level](features, embedded)
        free: Tensor = self.close(features)
        return free
