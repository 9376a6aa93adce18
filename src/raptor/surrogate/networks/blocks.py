"""Feature-wise linear modulation: parameters scale and shift every normalised channel.

FiLM (E. Perez et al. 2018, arXiv:1709.07871), in place of parameters as constant images.
"""

from torch import Tensor, nn

from raptor.dataset.scaling import INPUTS

MASKS = 2
"""Of the input channels, images; the others are constants."""

EMBEDDING = 64
"""Numbers that parameters are embedded in."""


class ParameterEmbedding(nn.Module):
    """Embeds the parameters of scaled inputs (n, 5, y, x) in (n, EMBEDDING) numbers."""

    def __init__(self) -> None:
        super().__init__()
        first, second = nn.Linear(len(INPUTS) - MASKS, EMBEDDING), nn.Linear(EMBEDDING, EMBEDDING)
        self.layers = nn.Sequential(first, nn.SiLU(), second, nn.SiLU())

    def forward(self, inputs: Tensor) -> Tensor:
        """The constant images of the parameters are read at one pixel."""
        embedding: Tensor = self.layers(inputs[:, MASKS:, 0, 0])
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
