"""How a field stack is best stored, and whether training is fed in time.

python -m benchmarks.storage results/paper [--channels 64]
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import netCDF4
import numpy as np
import torch
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.training import examples_a_second, published
from raptor.core.device import chosen_device
from raptor.dataset.examples import read_examples, training_scaling
from raptor.dataset.stack import read_samples, read_table
from raptor.moulds import moulds_by_id
from raptor.surrogate.batches import ExampleSet
from raptor.surrogate.rules import TrainingRules

CONSOLE = Console(width=110)
OPTIONS: dict[str, dict[str, Any]] = {
    "none": {},
    "zlib 1": {"compression": "zlib", "complevel": 1, "shuffle": True},
    "zlib 4": {"compression": "zlib", "complevel": 4, "shuffle": True},
    "zlib 9": {"compression": "zlib", "complevel": 9, "shuffle": True},
    "zstd 1": {"compression": "zstd", "complevel": 1, "shuffle": True},
    "zstd 9": {"compression": "zstd", "complevel": 9, "shuffle": True},
}
KEPT_BITS = (18, 15, 12)  # of the 23 after a float32's first


@dataclass(frozen=True)
class Stored:
    """What one way to store fields costs, a sample: bytes, seconds to write and to read, and error."""

    name: str
    size: float
    write: float
    read: float
    error: float


def compare_storage(fields: NDArray[np.float32], folder: Path) -> Iterator[Stored]:
    """Store fields (sample, 8, y, x) in every way, a chunk a sample.

    The error is relative to each field's largest value in the sample.
    """
    for name, options in OPTIONS.items():
        yield _store(name, fields, folder / "fields.nc", options)
    for bits in KEPT_BITS:
        rounding = {"significant_digits": bits, "quantize_mode": "BitRound"}
        for name in ("zlib 1", "zstd 1"):
            yield _store(f"{name}, {bits} bits", fields, folder / "fields.nc", OPTIONS[name] | rounding)


def _store(name: str, fields: NDArray[np.float32], path: Path, options: dict[str, Any]) -> Stored:
    started = time.perf_counter()
    with netCDF4.Dataset(path, "w") as file:
        for axis, size in zip("sfyx", fields.shape, strict=True):
            file.createDimension(axis, size)
        made = file.createVariable(
            "fields", "f4", tuple("sfyx"), chunksizes=(1, *fields.shape[1:]), **options
        )
        for row, sample in enumerate(fields):
            made[row] = sample
    write = time.perf_counter() - started
    order = np.random.default_rng(0).permutation(len(fields))
    with netCDF4.Dataset(path) as file:
        file.set_auto_mask(False)
        started = time.perf_counter()
        read = {row: file["fields"][row] for row in order}
        seconds = time.perf_counter() - started
    largest = np.maximum(np.abs(fields).max(axis=(2, 3)), 1e-30)
    error = max((np.abs(read[row] - fields[row]).max(axis=(1, 2)) / largest[row]).max() for row in order)
    n = len(fields)
    return Stored(name, path.stat().st_size / n, write / n, seconds / n, float(error))


def reading_rate(dataset: ExampleSet, batch_size: int) -> float:
    """Examples a second that are read from the stack, in a random order."""
    order = torch.randperm(len(dataset)).tolist()
    started = time.perf_counter()
    for _ in dataset.batches(order, batch_size, torch.device("cpu")):
        pass
    return len(dataset) / (time.perf_counter() - started)


def main(
    folder: Annotated[Path, typer.Argument(help="folder of a finished campaign")],
    samples: Annotated[int, typer.Option(min=8, help="samples to store and to load")] = 128,
    channels: Annotated[int, typer.Option(min=1, help="base channels of the network that is trained")] = 64,
    batch_size: Annotated[int, typer.Option(min=2)] = 4,
) -> None:
    """Storage of a data set's fields, the rate of reading, and the appetite of training, in one run."""
    stack = folder / "fields.nc"
    pixels = read_table(stack).pixels
    rows = range(min(samples, len(read_table(stack).split)))
    fields = np.stack([sample.fields for sample in read_samples(stack, rows)])
    with TemporaryDirectory() as temporary:
        stored = list(compare_storage(fields, Path(temporary)))
    table = Table(title=f"{len(fields)} samples of 8 x {pixels} x {pixels} float32, a chunk a sample")
    for head in ("storage", "kB a sample", "write, ms", "read, samples/s", "largest relative error"):
        table.add_column(head, justify="right")
    for s in stored:
        error = f"{s.error:.1e}" if s.error else "0"
        table.add_row(s.name, f"{s.size / 1e3:.0f}", f"{s.write * 1e3:.1f}", f"{1 / s.read:.0f}", error)
    CONSOLE.print(table)

    examples = list(islice(read_examples(folder / "examples.csv"), 4 * samples))
    dataset = ExampleSet(stack, examples, moulds_by_id(folder / "moulds.geojson"), training_scaling(stack))
    table = Table(title=f"One epoch of {len(examples)} examples, batches of {batch_size}")
    for head in ("what", "samples/s"):
        table.add_column(head, justify="right")
    table.add_row("reading examples", f"{reading_rate(dataset, batch_size):.0f}")
    device, threads = chosen_device("auto"), torch.get_num_threads()
    rules = TrainingRules(batch_size=batch_size, lambda_l1=100.0)
    rate = examples_a_second(published(pixels, channels), rules, device)
    place = "GPU" if device == "cuda" else f"{threads} threads"
    table.add_row(f"training, {channels} base channels, {place}", f"{rate:.1f}")
    CONSOLE.print(table)


if __name__ == "__main__":
    typer.run(main)
