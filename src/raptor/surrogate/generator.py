"""From scaled inputs to scaled fields: a network and the physical constraints on its outputs."""

from collections.abc import Mapping

import torch
from torch import Tensor, nn

from raptor.dataset.scaling import INPUTS, Scaling
from raptor.parameters import DELTA
from raptor.surrogate.constraints import PhysicalFields
from raptor.surrogate.networks import NETWORKS, PHYSICAL
from raptor.surrogate.rules import Architecture


class Generator(nn.Module):
    """An architecture's network, followed by `physical` if its channels are free."""

    def __init__(self, architecture: Architecture, scaling: Scaling) -> None:
        super().__init__()
        self.network = NETWORKS[architecture.network](architecture)
        self.noise = architecture.noise
        self.physical = PhysicalFields(scaling) if architecture.network in PHYSICAL else None

    def forward(self, inputs: Tensor, cells: Tensor, noise: Tensor | None = None) -> Tensor:
        """Fields (n, 8, y, x) from inputs (n, 6, y, x), numbers of cells (n,) and optional noise (n, k)."""
        found: Tensor = self.network(inputs) if noise is None else self.network(inputs, noise)
        if self.physical is None:
            return found
        fields: Tensor = self.physical(found.float(), 0.5 * (inputs[:, :1] + 1), cells, delta_of(inputs))
        return fields

    def answers(self, inputs: Tensor, cells: Tensor, count: int, stream: torch.Generator) -> Tensor:
        """Samples (n, count, 8, y, x) with noise drawn from a stream, or the one mean (n, 1, 8, y, x)."""
        if not self.noise:
            return torch.stack([self(inputs, cells)], dim=1)
        noise = torch.randn(count, len(inputs), self.noise, generator=stream).to(inputs.device)
        return torch.stack([self(inputs, cells, each) for each in noise], dim=1)

    def normalisations(self) -> list[nn.BatchNorm2d]:
        """Layers of batch normalisation."""
        return [module for module in self.modules() if isinstance(module, nn.BatchNorm2d)]

    def start_from(self, weights: Mapping[str, Tensor]) -> None:
        """Load the weights of another network, which may lack this one's noise.

        Raises
        ------
        RuntimeError
            If they are of another architecture.
        """
        own = {
            name: value for name, value in self.state_dict().items() if name.endswith("embed.noise.weight")
        }
        self.load_state_dict(own | dict(weights))


def delta_of(inputs: Tensor) -> Tensor:
    """Delta (n,) of scaled inputs (n, 6, y, x)."""
    return DELTA.middle + DELTA.half * inputs[:, INPUTS.index("delta"), 0, 0]
