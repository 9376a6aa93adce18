"""Networks from scaled inputs (n, 6, y, x) to eight channels (n, 8, y, x), by name.

To add one, write its module, and list it here and in `rules.Architecture`.
"""

from collections.abc import Callable

from torch import nn

from raptor.surrogate.networks import film_unet, fno, pix2pix
from raptor.surrogate.networks.pix2pix import Discriminator
from raptor.surrogate.rules import Architecture

NETWORKS: dict[str, Callable[[Architecture], nn.Module]] = {
    "film_unet": film_unet.build,
    "pix2pix": pix2pix.build,
    "pix2pix_film": pix2pix.build_film,
    "fno": fno.build,
}

PHYSICAL = ("film_unet", "fno")
"""Networks whose channels are free, made to obey the physics by `constraints.PhysicalFields`."""

__all__ = ["NETWORKS", "PHYSICAL", "Discriminator"]
