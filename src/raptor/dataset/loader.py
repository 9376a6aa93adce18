"""Examples for torch: read lazily from stacks, transformed and scaled."""

import os
from bisect import bisect_right
from collections.abc import Sequence
from pathlib import Path

import h5py
import torch
from torch import Tensor
from torch.utils.data import Dataset

from raptor.dataset.examples import Example
from raptor.dataset.scaling import Scaling, scale_inputs
from raptor.dataset.stack import read_table
from raptor.fields.resample import pooled
from raptor.symmetry import Element, apply, move_pixels


class ExampleSet(Dataset[tuple[Tensor, Tensor]]):
    """Pairs of inputs (5, y, x) and targets (8, y, x), both scaled, float32.

    Stacks are opened on first use, by each process that reads for itself, and read one sample at a
    time: what is in memory does not grow with them. Rows of several are counted through.

    Raises
    ------
    RaptorError
        Where a stack cannot be read.
    """

    def __init__(
        self,
        stacks: Path | Sequence[Path],
        examples: list[Example],
        scaling: Scaling,
        pixels: int | None = None,
    ) -> None:
        self.stacks = [stacks] if isinstance(stacks, Path) else list(stacks)
        tables = [read_table(stack) for stack in self.stacks]
        self.starts = [0]
        for table in tables[:-1]:
            self.starts.append(self.starts[-1] + len(table.parameters))
        self.examples = examples
        self.scaling = scaling
        self.pixels = pixels or tables[0].pixels
        self.parameters = [values for table in tables for values in table.parameters]
        self._files: list[h5py.File] = []
        self._reader = 0

    def __len__(self) -> int:
        return len(self.examples)

    def __getstate__(self) -> dict[str, object]:
        """Without the open file, so that a worker may be started by any means."""
        return vars(self) | {"_files": []}

    def _open(self) -> list[h5py.File]:
        """The stacks, opened by this process: HDF5 must not share a file with a parent that forked."""
        if not self._files or self._reader != os.getpid():
            self._files, self._reader = [h5py.File(stack, "r") for stack in self.stacks], os.getpid()
        return self._files

    def sample(self, row: int, element: Element | None = None) -> tuple[Tensor, Tensor]:
        """Scaled inputs (5, y, x) and targets (8, y, x) of a row, moved by an element of D4."""
        element = element or Element(0, mirror=False)
        number = bisect_right(self.starts, row) - 1
        file, local = self._open()[number], row - self.starts[number]
        depression, tethers = (move_pixels(file[name][local], element) for name in ("depression", "tethers"))
        inputs = scale_inputs(depression, tethers, self.parameters[row])
        target = self.scaling.forward(apply(file["fields"][local], element))
        return pooled(torch.from_numpy(inputs), self.pixels), pooled(torch.from_numpy(target), self.pixels)

    def __getitem__(self, number: int) -> tuple[Tensor, Tensor]:
        example = self.examples[number]
        return self.sample(example.sample, Element.from_index(example.element))
