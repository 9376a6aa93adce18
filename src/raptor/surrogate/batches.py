"""Batches of examples for training: kept in memory where they fit, else read ahead of the network."""

from collections.abc import Iterable, Iterator, Sequence

import torch
from torch import Tensor
from torch.utils.data import DataLoader

from raptor.dataset.loader import ExampleSet
from raptor.dataset.scaling import INPUTS
from raptor.symmetry import FIELDS, Element, apply, move_pixels

ROOM = 3 * 2**30  # bytes of the processor's memory that samples may take
Batches = Iterable[tuple[Tensor, Tensor]]


def samples_of(dataset: ExampleSet) -> list[int]:
    """Rows of the stack that a set's examples are images of."""
    return sorted({example.sample for example in dataset.examples})


def fit_on(device: torch.device, datasets: Sequence[ExampleSet]) -> bool:
    """Whether all samples of some sets fit in half of a GPU's free memory, or `ROOM` of the processor's."""
    room = 0.5 * torch.cuda.mem_get_info(device)[0] if device.type == "cuda" else ROOM
    numbers = sum(len(samples_of(dataset)) * dataset.pixels**2 for dataset in datasets)
    return bool(4 * (len(INPUTS) + len(FIELDS)) * numbers < room)


class Feeder:
    """Gives the examples of a set in any order, in batches on a device.

    Where they are `resident`, samples are read once and stay on the device, and images are moved under D4
    there. Otherwise they are read as they are needed, by `workers` processes of their own if there are any.
    """

    def __init__(
        self, dataset: ExampleSet, device: torch.device, workers: int = 0, resident: bool = False
    ) -> None:
        self.dataset, self.device, self.workers, self.resident = dataset, device, workers, resident
        if resident:
            self._load()

    def __len__(self) -> int:
        return len(self.dataset)

    def _load(self) -> None:
        rows, size = samples_of(self.dataset), 2 * (self.dataset.pixels,)
        self.place = {row: number for number, row in enumerate(rows)}
        self.inputs = torch.empty(len(rows), len(INPUTS), *size, device=self.device)
        self.targets = torch.empty(len(rows), len(FIELDS), *size, device=self.device)
        for number, row in enumerate(rows):
            inputs, target = self.dataset.sample(row)
            self.inputs[number].copy_(inputs)
            self.targets[number].copy_(target)

    def batches(self, order: Sequence[int], size: int) -> Batches:
        """Inputs (n, 5, y, x) and targets (n, 8, y, x) of the examples in this order, n = size or fewer."""
        if self.resident:
            return self._moved(order, size)
        loader = DataLoader(self.dataset, size, sampler=order, num_workers=self.workers)
        return ((inputs.to(self.device), target.to(self.device)) for inputs, target in loader)

    def _moved(self, order: Sequence[int], size: int) -> Iterator[tuple[Tensor, Tensor]]:
        for start in range(0, len(order), size):
            chosen = [self.dataset.examples[number] for number in order[start : start + size]]
            where = [(self.place[e.sample], Element.from_index(e.element)) for e in chosen]
            yield (
                torch.stack([move_pixels(self.inputs[row], element) for row, element in where]),
                torch.stack([apply(self.targets[row], element) for row, element in where]),
            )
