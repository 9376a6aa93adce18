"""Examples for torch: read lazily from the stack, transformed and scaled."""

import os
from pathlib import Path

import h5py
import torch
from torch import Tensor
from torch.utils.data import Dataset

from raptor.dataset.examples import Example
from raptor.dataset.scaling import Scaling, scale_inputs
from raptor.dataset.stack import read_table
from raptor.resolution import pooled
from raptor.symmetry import Element, apply, move_pixels


class ExampleSet(Dataset[tuple[Tensor, Tensor]]):
    """Pairs of inputs (5, y, x) and targets (8, y, x), both scaled, float32.

    The stack is opened on first use, by each process that reads for itself, and read one sample at a
    time: what is in memory does not grow with the stack.

    Raises
    ------
    RaptorError
        Where the stack cannot be read.
    """

    def __init__(
        self, stack: Path, examples: list[Example], scaling: Scaling, pixels: int | None = None
    ) -> None:
        table = read_table(stack)
        self.stack = Path(stack)
        self.examples = examples
        self.scaling = scaling
        self.pixels = pixels or table.pixels
        self.parameters = table.parameters
        self._file: h5py.File | None = None
        self._reader = 0

    def __len__(self) -> int:
        return len(self.examples)

    def __getstate__(self) -> dict[str, object]:
        """Without the open file, so that a worker may be started by any means."""
        return vars(self) | {"_file": None}

    def _open(self) -> h5py.File:
        """The stack, opened by this process: HDF5 must not share a file with a parent that forked."""
        if self._file is None or self._reader != os.getpid():
            self._file, self._reader = h5py.File(self.stack, "r"), os.getpid()
        return self._file

    def sample(self, row: int, element: Element | None = None) -> tuple[Tensor, Tensor]:
        """Scaled inputs (5, y, x) and targets (8, y, x) of a row of the stack, moved by an element of D4."""
        element = element or Element(0, mirror=False)
        file = self._open()
        depression, tethers = (move_pixels(file[name][row], element) for name in ("depression", "tethers"))
        inputs = scale_inputs(depression, tethers, self.parameters[row])
        target = self.scaling.forward(apply(file["fields"][row], element))
        return pooled(torch.from_numpy(inputs), self.pixels), pooled(torch.from_numpy(target), self.pixels)

    def __getitem__(self, number: int) -> tuple[Tensor, Tensor]:
        example = self.examples[number]
        return self.sample(example.sample, Element.from_index(example.element))
