"""Examples as tensors, in batches: kept in memory if they fit, otherwise read as needed."""

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, cached_property
from itertools import accumulate
from pathlib import Path

import h5py
import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from raptor.core.errors import RaptorError
from raptor.dataset.examples import Example
from raptor.dataset.scaling import INPUTS, Scaling, scale_inputs
from raptor.dataset.stack import read_table
from raptor.fields.resample import block_average, coarse_images
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.symmetry import FIELDS, Element, move_pixels

MEMORY = 3 * 2**30
"""Bytes of the processor's memory that examples may use."""

AT_ONCE = 8
"""Batches put together at once, so that a GPU waits less often."""

RIM = 4
"""Pixels that a mould is kept from the image's rim, so that density in its walls is not cut off."""

Batch = tuple[Tensor, Tensor]
"""Scaled inputs (n, 6, y, x) and targets (n, 8, y, x)."""


class ExampleSet(Dataset[Batch]):
    """Pairs of scaled inputs (6, y, x) and targets (8, y, x), float32, of examples of one or more stacks.

    Reads one sample at a time, so memory does not grow with the stacks unless `keep` is called. Rows of
    several stacks are numbered consecutively.

    Parameters
    ----------
    moulds : mapping of str to Mould
        Those of the stacks, by id: the density as cast, which networks see, is not in a stack.
    pixels : int, optional
        Side of the images, block averages of the stacks'; theirs by default.

    Raises
    ------
    RaptorError
        If a stack cannot be read, or one of its moulds is not given.
    """

    def __init__(
        self,
        stacks: Path | Sequence[Path],
        examples: Sequence[Example],
        moulds: Mapping[str, Mould],
        scaling: Scaling,
        pixels: int | None = None,
    ) -> None:
        self.stacks = [stacks] if isinstance(stacks, Path) else list(stacks)
        tables = [read_table(stack) for stack in self.stacks]
        self.parameters = [values for table in tables for values in table.parameters]
        unknown = {name for table in tables for name in table.mould} - moulds.keys()
        if unknown:
            raise RaptorError(
                f"mould {min(unknown)} of the stacks is not among the {len(moulds)} given; give those of the "
                "file moulds.geojson beside each stack"
            )
        self.casts = [
            CastMould(moulds[name], table.layers, table.pixels) for table in tables for name in table.mould
        ]
        self.starts = [0, *accumulate(len(table.parameters) for table in tables)][:-1]
        self.examples, self.scaling = examples, scaling
        self.pixels = pixels or tables[0].pixels
        self.kept: Batch | None = None

    def __len__(self) -> int:
        return len(self.examples)

    def __getitem__(self, number: int) -> Batch:
        """Inputs and targets of an example."""
        ((inputs, targets),) = self.batches([number], 1, torch.device("cpu"))
        return inputs[0], targets[0]

    def read(self, row: int) -> Batch:
        """Inputs and targets of a row of the stacks, as simulated."""
        number = bisect_right(self.starts, row) - 1
        with h5py.File(self.stacks[number], "r") as file:
            fields = file["fields"][row - self.starts[number]]
        # A copy of the mould, so that its images do not stay in memory.
        inputs = scale_inputs(coarse_images(replace(self.casts[row]), self.pixels), self.parameters[row])
        target = block_average(self.scaling.forward(fields), self.pixels)
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
        shape = self.pixels, self.pixels
        inputs = torch.empty(len(self.images), len(INPUTS), *shape, device=device)
        targets = torch.empty(len(self.images), len(FIELDS), *shape, device=device)
        for place, row in enumerate(self.images):
            inputs[place], targets[place] = self.read(row)
        self.kept = inputs, targets

    def batches(
        self, order: Sequence[int], size: int, device: torch.device, *, shifted: bool = False
    ) -> Iterator[Batch]:
        """Batches of `size` examples, or fewer at the end, in this order; at random places if `shifted`."""
        for start in range(0, len(order), AT_ONCE * size):
            chosen = [self.examples[number] for number in order[start : start + AT_ONCE * size]]
            inputs, targets = self._as_simulated([example.sample for example in chosen])
            elements = torch.tensor([example.element for example in chosen])
            images = images_under(elements, inputs.to(device), targets.to(device))
            if shifted:
                images = shifted_at_random(*images)
            yield from zip(*(torch.split(each, size) for each in images), strict=True)

    def _as_simulated(self, rows: Sequence[int]) -> Batch:
        """Inputs and targets of rows of the stacks, where they are kept."""
        if self.kept is None:
            inputs, targets = zip(*map(self.read, rows), strict=True)
            return torch.stack(inputs), torch.stack(targets)
        places = torch.tensor([self.place_of[row] for row in rows]).to(self.kept[0].device)
        return self.kept[0][places], self.kept[1][places]

    @cached_property
    def place_of(self) -> dict[int, int]:
        """Place of each row of the stacks among those kept."""
        return {row: place for place, row in enumerate(self.images)}


def images_under(elements: Tensor, inputs: Tensor, targets: Tensor) -> Batch:
    """Inputs (n, 6, y, x) and targets (n, 8, y, x), each in its image under an element of D4, indices (n,).

    All at once: element by element, a GPU would wait for the processor's launches.
    """
    moves, channels, signs = (table[elements].to(inputs.device) for table in _tables(inputs.shape[-1]))
    each = torch.arange(len(inputs), device=inputs.device)[:, None, None]
    moved = inputs.flatten(2)[each, torch.arange(len(INPUTS), device=inputs.device)[:, None], moves[:, None]]
    applied = targets.flatten(2)[each, channels[:, :, None], moves[:, None]] * signs[:, :, None]
    return moved.reshape(inputs.shape), applied.reshape(targets.shape)


def shifted_at_random(inputs: Tensor, targets: Tensor) -> Batch:
    """Inputs (n, 6, y, x) and targets (n, 8, y, x), each moved by whole pixels, as far as its mould allows.

    A tissue is the same wherever its mould lies, lattice included, and what is outside the mould is empty.
    """
    side, there = inputs.shape[-1], inputs[:, 0] > -1
    places = torch.arange(side, device=inputs.device)
    sources = []
    for axis in (2, 1):  # rows with any of the mould in them, then columns
        lines = there.any(axis).int()
        first, last = lines.argmax(1), side - 1 - lines.flip(1).argmax(1)
        back, forth = ((room - RIM).clamp(min=0) for room in (first, side - 1 - last))
        steps = (torch.rand(len(inputs), device=inputs.device) * (back + forth + 1)).long() - back
        sources.append((places - steps[:, None]) % side)
    rows, columns = sources
    source = (side * rows[:, :, None] + columns[:, None, :]).flatten(1)[:, None]
    moved = [each.flatten(2).gather(2, source.expand(-1, each.shape[1], -1)) for each in (inputs, targets)]
    return moved[0].reshape(inputs.shape), moved[1].reshape(targets.shape)


@cache
def _tables(pixels: int) -> tuple[Tensor, Tensor, Tensor]:
    """Of each element: the pixel that every pixel comes from, the channel that every one does, its sign."""
    places = np.arange(pixels**2).reshape(pixels, pixels)
    moves = np.array([move_pixels(places, element).ravel() for element in Element.all()])
    channels, signs = zip(*(zip(*element.permutation, strict=True) for element in Element.all()), strict=True)
    return torch.from_numpy(moves), torch.tensor(channels), torch.tensor(signs, dtype=torch.float32)


def split_examples(
    stacks: Sequence[Path],
    examples: Iterable[Example],
    splits: Sequence[str],
    moulds: Mapping[str, Mould],
    scaling: Scaling,
    pixels: int,
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
            keys = "runs" if name == "train" else f"runs or its {name}"
            raise RaptorError(f"there is no {name} example; raise the campaign's {keys}")
    training, validation = (ExampleSet(stacks, part, moulds, scaling, pixels) for part in parts.values())
    return training, validation


def keep_if_they_fit(sets: Sequence[ExampleSet], device: torch.device) -> None:
    """Keep all samples on a device if they take less than half of a GPU's free memory, or `MEMORY`."""
    free = 0.5 * torch.cuda.mem_get_info(device)[0] if device.type == "cuda" else MEMORY
    numbers = sum(len(each.images) * each.pixels**2 for each in sets) * (len(INPUTS) + len(FIELDS))
    if numbers * torch.finfo(torch.float32).bits // 8 < free:
        for each in sets:
            each.keep(device)
