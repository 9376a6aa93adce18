"""Batches of examples for training: kept on a GPU where they fit, else read ahead of it."""

from collections.abc import Iterable, Iterator, Sequence

import torch
from torch import Tensor
from torch.utils.data import DataLoader

from raptor.dataset.loader import ExampleSet
from raptor.symmetry import Element

Batches = Iterable[tuple[Tensor, Tensor]]


def move_pixels(images: Tensor, element: Element) -> Tensor:
    """`raptor.symmetry.move_pixels` for tensors (..., y, x)."""
    moved = images.flip(-1) if element.mirror else images
    return torch.rot90(moved, -element.quarter_turns, dims=(-2, -1))


def apply(fields: Tensor, element: Element) -> Tensor:
    """`raptor.symmetry.apply` for tensors (..., 8, y, x)."""
    source, sign = element.permutation
    signs = torch.tensor(sign, dtype=fields.dtype, device=fields.device)
    return move_pixels(fields, element)[..., source, :, :] * signs[:, None, None]


class Feeder:
    """Gives the examples of a set in any order, in batches on a device.

    Where a GPU has room for all samples at half of its free memory, they are read once and stay there;
    images are moved under D4 on the device. Otherwise they are read as they are needed, by `workers`
    processes of their own if there are any.
    """

    def __init__(
        self, dataset: ExampleSet, device: torch.device, workers: int = 0, resident: bool | None = None
    ) -> None:
        self.dataset, self.device, self.workers = dataset, device, workers
        self.rows = sorted({example.sample for example in dataset.examples})
        self.resident = self._fits() if resident is None else resident
        if self.resident:
            self._load()

    def __len__(self) -> int:
        return len(self.dataset)

    def _fits(self) -> bool:
        if self.device.type != "cuda":
            return False
        inputs, target = self.dataset[0]
        size = 4 * len(self.rows) * (inputs.numel() + target.numel())
        return size < 0.5 * torch.cuda.mem_get_info(self.device)[0]

    def _load(self) -> None:
        pairs = [self.dataset.sample(row) for row in self.rows]
        self.place = {row: number for number, row in enumerate(self.rows)}
        self.inputs, self.targets = (
            torch.stack([pair[part] for pair in pairs]).to(self.device) for part in (0, 1)
        )

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
