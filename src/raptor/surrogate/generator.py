"""From scaled inputs to scaled fields: a network, and the physics of its outputs."""

from torch import Tensor, nn

from raptor.dataset.scaling import Scaling
from raptor.surrogate.constraints import PhysicalFields
from raptor.surrogate.networks import NETWORKS, PHYSICAL
from raptor.surrogate.rules import Architecture


class Generator(nn.Module):
    """An architecture's network; its outputs obey the physics where the network leaves that to `physical`."""

    def __init__(self, architecture: Architecture, scaling: Scaling) -> None:
        super().__init__()
        self.network = NETWORKS[architecture.network](architecture)
        self.physical = PhysicalFields(scaling) if architecture.network in PHYSICAL else None

    def forward(self, inputs: Tensor, cells: Tensor) -> Tensor:
        """Fields (n, 8, y, x) of inputs (n, 5, y, x) and numbers of cells (n,)."""
        found: Tensor = self.network(inputs)
        if self.physical is None:
            return found
        fields: Tensor = self.physical(found.float(), 0.5 * (inputs[:, :1] + 1), cells)
        return fields
