"""Feature-wise linear modulation: parameters scale and shift every normalised channel.

FiLM (E. Perez et al. 2018, arXiv:1709.07871), instead of parameters as constant images. With noise added, a
network gives samples (functional generative networks, Alet et al. 2025, arXiv:2506.10772).
"""

from torch import Tensor, nn

from raptor.dataset.scaling import INPUTS

IMAGES = 3
"""Input channels that are images; the others are constants."""

EMBEDDING = 64
"""Size of the embedding of the parameters."""

NOISE_WEIGHT = 0.05
"""Deviation of the initial weights of noise: small, so that a network starts from its mean."""


class ParameterEmbedding(nn.Module):
    """Embeds the parameters of scaled inputs (n, 6, y, x), and noise if any, in (n, EMBEDDING) numbers."""

    def __init__(self, noise: int = 0) -> None:
        super().__init__()
        first, second = nn.Linear(len(INPUTS) - IMAGES, EMBEDDING), nn.Linear(EMBEDDING, EMBEDDING)
        self.layers = nn.Sequential(first, nn.SiLU(), second, nn.SiLU())
        self.noise = nn.Linear(noise, EMBEDDING, bias=False) if noise else None
        if self.noise is not None:
            nn.init.normal_(self.noise.weight, 0.0, NOISE_WEIGHT)

    def forward(self, inputs: Tensor, noise: Tensor | None = None) -> Tensor:
        """Reads the constant images of the parameters at one pixel; noise is (n, numbers)."""
        features: Tensor = self.layers[0](inputs[:, IMAGES:, 0, 0])
        if self.noise is not None:
            features = features + self.noise(noise)
        embedding: Tensor = self.layers[1:](features)
        return embedding


class FilmNorm(nn.Module):
    """Batch normalisation, then modulation: y = (1 + scale) norm(x) + shift."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.norm = nn.BatchNorm2d(channels)
        self.modulation = nn.Linear(EMBEDDING, 2 * channels)
        nn.init.zeros_(self.modulation.weight)
        nn.init.zeros_(self.modulation.bias)

    def forward(self, features: Tensor, embedding: Tensor) -> Tensor:
        """Features (n, channels, y, x), modulated by an embedding (n, EMBEDDING)."""
        scale, shift = self.modulation(embedding)[:, :, None, None].chunk(2, dim=1)
        modulated: Tensor = self.norm(features) * (1 + scale) + shift
        return modulated
