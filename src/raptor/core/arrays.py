"""Arrays of numpy and tensors of torch, for formulas that serve both."""

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeVar

from numpy.typing import NDArray

if TYPE_CHECKING:  # what needs no tensors does not wait for torch
    from torch import Tensor

Array = TypeVar("Array", NDArray[Any], "Tensor")


def library_of(array: Any) -> ModuleType:
    """The library of an array: numpy or torch, which name flip, rot90, stack, concat and asarray alike."""
    return sys.modules[type(array).__module__.partition(".")[0]]
