"""Examples for torch: read lazily from the stack, transformed and scaled."""

from pathlib import Path

import h5py
import torch
from torch import Tensor
from torch.utils.data import Dataset

from raptor.dataset.examples import Example
from raptor.dataset.scaling import Scaling, scale_inputs
from raptor.dataset.shards import PARAMETERS
from raptor.parameters import CellParameters
from raptor.symmetry import Element, apply, move_pixels


class ExampleSet(Dataset[tuple[Tensor, Tensor]]):
    """Pairs of inputs (5, y, x) and targets (8, y, x), both scaled, float32.

    The stack is opened on first use, once in each worker process, and read one sample at a time.
    """

    def __init__(self, stack: Path, examples: list[Example], scaling: Scaling) -> None:
        self.stack = Path(stack)
        self.examples = examples
        self.scaling = scaling
        self._file: h5py.File | None = None

    def __len__(self) -> int:
        return len(self.examples)

    def __getitem__(self, number: int) -> tuple[Tensor, Tensor]:
        if self._file is None:
            self._file = h5py.File(self.stack, "r")
        file, example = self._file, self.examples[number]
        element = Element.from_index(example.element)
        parameters = CellParameters(*(float(file[name][example.sample]) for name in PARAMETERS))
        depression, tethers = (
            move_pixels(file[name][example.sample], element) for name in ("depression", "tethers")
        )
        inputs = scale_inputs(depression, tethers, parameters)
        target = self.scaling.forward(apply(file["fields"][example.sample], element))
        return torch.from_numpy(inputs), torch.from_numpy(target)
