"""A Fourier neural operator (Li et al. 2021, arXiv:2010.08895), by the library neuraloperator."""

from types import MethodType

from torch import nn

from raptor.dataset.scaling import INPUTS
from raptor.surrogate.rules import Architecture
from raptor.symmetry import FIELDS

MODES = 12
"""Fourier modes kept along each axis."""


def build(architecture: Architecture) -> nn.Module:
    """The network of an architecture."""
    from neuralop.models import FNO  # here, because it is slow to import

    modes = min(MODES, architecture.pixels // 2)
    operator: nn.Module = FNO(
        n_modes=(modes, modes),
        in_channels=len(INPUTS),
        out_channels=len(FIELDS),
        hidden_channels=architecture.base_channels,
    )
    # The library's state_dict adds metadata that neither checkpoints nor safetensors take.
    operator.state_dict = MethodType(nn.Module.state_dict, operator)  # type: ignore[method-assign]
    return operator
