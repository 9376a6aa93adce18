"""Examples as tensors, in batches: kept in memory if they fit, otherwise read as needed."""

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import accumulate
from pathlib import Path

import h5py
import torch
from torch import Tensor
from torch.utils.data import Dataset

from raptor.core.errors import RaptorError
from raptor.dataset.examples import Example
from raptor.dataset.scaling import INPUTS, Scaling, scale_inputs
from raptor.dataset.stack import read_table
from raptor.fields.resample import block_average
from raptor.symmetry import FIELDS, Element, apply, move_pixels

MEMORY = 3 * 2**30
"""Bytes of the processor's memory that examples may use."""

Batch = tuple[Tensor, Tensor]
"""Scaled inputs (n, 5, y, x) and targets (n, 8, y, x)."""


class ExampleSet(Dataset[Batch]):
    """Pairs of scaled inputs (5, y, x) and targets (8, y, x), float32, of examples of one or more stacks.

    Reads one sample at a time, so memory does not grow with the stacks unless `keep` is called. Rows of
    several stacks are numbered consecutively.

    Parameters
    ----------
    pixels : int, optional
        Side of the images, block averages of the stacks'; theirs by default.

    Raises
    ------
    RaptorError
        If a stack cannot be read.
    """

    def __init__(
        self,
        stacks: Path | Sequence[Path],
        examples: Sequence[Example],
        scaling: Scaling,
        pixels: int | None = None,
    ) -> None:
        self.stacks = [stacks] if isinstance(stacks, Path) else list(stacks)
        tables = [read_table(stack) for stack in self.stacks]
        self.parameters = [values for table in tables for values in table.parameters]
        self.starts = [0, *accumulate(len(table.parameters) for table in tables)][:-1]
        self.examples, self.scaling = examples, scaling
        self.pixels = pixels or tables[0].pixels
        self.kept: dict[int, Batch] = {}

    def __len__(self) -> int:
        return len(self.examples)

    def __getitem__(self, number: int) -> Batch:
        """Inputs and targets of an example."""
        example = self.examples[number]
        inputs, target = self.kept.get(example.sample) or self.read(example.sample)
        element = Element.from_index(example.element)
        return move_pixels(inputs, element), apply(target, element)

    def read(self, row: int) -> Batch:
        """Inputs and targets of a row of the stacks, as simulated."""
        number = bisect_right(self.starts, row) - 1
        with h5py.File(self.stacks[number], "r") as file:
            depression, tethers, fields = (
                file[name][row - self.starts[number]] for name in ("depression", "tethers", "fields")
            )
        inputs = scale_inputs(depression, tethers, self.parameters[row])
        inputs, target = (
            block_average(inputs, self.pixels),
            block_average(self.scaling.forward(fields), self.pixels),
        )
        return torch.from_numpy(inputs), torch.from_numpy(target)

    @cached_property
    def images(self) -> dict[int, list[int]]:
        """Numbers of the examples of each sample, by its row."""
        found: dict[int, list[int]] = {}
        for number, example in enumerate(self.examples):
            found.setdefault(example.sample, []).append(number)
        return found

    def shuffled(self) -> list[int]:
        """One random example of each sample, in random order, by torch's own generator."""
        chosen = [numbers[int(torch.randint(len(numbers), ()))] for numbers in self.images.values()]
        return [chosen[place] for place in torch.randperm(len(chosen)).tolist()]

    def keep(self, device: torch.device) -> None:
        """Read every sample once and keep it on a device, where it is then transformed under D4."""
        for row in sorted(self.images):
            inputs, target = self.read(row)
            self.kept[row] = inputs.to(device), target.to(device)

    def batches(self, order: Sequence[int], size: int, device: torch.device) -> Iterator[Batch]:
        """Batches of `size` examples, or fewer at the end, in this order."""
        for start in range(0, len(order), size):
            inputs, targets = zip(*(self[number] for number in order[start : start + size]), strict=True)
            yield torch.stack(inputs).to(device), torch.stack(targets).to(device)


def split_examples(
    stacks: Sequence[Path], examples: Iterable[Example], splits: Sequence[str], scaling: Scaling, pixels: int
) -> tuple[ExampleSet, ExampleSet]:
    """Examples of the training and of the validation split.

    Parameters
    ----------
    splits : sequence of str
        Split of each sample of the stacks, rows numbered consecutively.

    Raises
    ------
    RaptorError
        If a split has no example.
    """
    parts: dict[str, list[Example]] = {"train": [], "validation": []}
    for example in examples:
        if splits[example.sample] in parts:
            parts[splits[example.sample]].append(example)
    for name, part in parts.items():
        if not part:
            raise RaptorError(f"there is no {name} example; raise design.simulations or design.{name}")
    training, validation = (ExampleSet(stacks, part, scaling, pixels) for part in parts.values())
    return training, validation


def keep_if_they_fit(sets: Sequence[ExampleSet], device: torch.device) -> None:
    """Keep all samples on a device if they take less than half of a GPU's free memory, or `MEMORY`."""
    free = 0.5 * torch.cuda.mem_get_info(device)[0] if device.type == "cuda" else MEMORY
    numbers = sum(len(each.images) * each.pixels**2 for each in sets) * (len(INPUTS) + len(FIELDS))
    if numbers * torch.finfo(torch.float32).bits // 8 < free:
        for each in sets:
            each.keep(device)
