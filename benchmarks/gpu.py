"""What a GPU makes of a configuration.

python -m benchmarks.gpu config/paper.yaml --output gpu.json

Checks batches against the compiled solver, then times the simulation of the whole design (or of as much as
the time allows), its images, training and prediction, beside what the device can do at most. It runs on
the processor too, where it shows that everything works. It has never yet been run on a GPU.
"""

import json
import os
import platform
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.kernels import OPERATIONS
from benchmarks.training import examples_a_second, published
from raptor.condor.gpu.contract import BatchSolver, Task, room_for_cells
from raptor.condor.gpu.energy import objective
from raptor.condor.gpu.layout import BLOCK, build_batch, cast
from raptor.condor.gpu.raster import rasterise as rasterise_on
from raptor.condor.simulate import Tissue, simulate
from raptor.config import Configuration, load
from raptor.core.device import chosen_device
from raptor.core.files import atomic_path
from raptor.dataset.design import Run
from raptor.dataset.scaling import INPUTS, Scaling
from raptor.fields.metrics import vrmse
from raptor.moulds.geometry import Mould
from raptor.parameters import NetworkModel
from raptor.raster import rasterise
from raptor.surrogate.generator import Generator
from raptor.surrogate.rules import Architecture, TrainingRules
from raptor.symmetry import FIELDS

CONSOLE = Console(width=110)
BYTES = 4 * (1 + 6)  # that a directed bond moves: an address and six gathered numbers, but for caches


@dataclass(frozen=True)
class Agreement:
    """A batch beside single runs, over some moulds: medians of what is relative to the mean of two seeds.

    Energies less than that of single runs are negative. Errors of density are VRMSE against a single
    run's image: the batch's, and another seed's.
    """

    moulds: int
    energy: float
    energy_of_seeds: float
    density_error: float
    density_error_of_seeds: float
    converged: int
    inverted: int


@dataclass(frozen=True)
class Timed:
    """A share of a design, timed: cast on the processor, contracted, and made images on the device.

    `evaluations` are of the gradient of one cell.
    """

    simulations: int
    of: int
    cells: int
    evaluations: float
    cast_seconds: float
    seconds: float
    raster_seconds: float


def _single(job: tuple[Mould, Run, NetworkModel, int]) -> Tissue:
    mould, run, model, seed = job
    return simulate(mould, run.parameters, model, "standard", seed)


def in_processes(work: Callable[..., Any], jobs: Sequence[Any]) -> list[Any]:
    """Results of work on jobs, by all processors, forked before a GPU is touched."""
    with ProcessPoolExecutor(os.cpu_count(), get_context("fork")) as pool:
        return list(pool.map(work, jobs, chunksize=max(1, len(jobs) // 256)))


def agreement(
    tasks: list[Task], singles: list[Tissue], model: NetworkModel, pixels: int, device: torch.device
) -> Agreement:
    """Hold a batch against single runs, two seeds of each task one after the other."""
    together = dict(BatchSolver(tasks, model, "standard", device).run())

    def density(tissue: Tissue) -> NDArray[np.float64]:
        return np.asarray(rasterise(tissue.positions, tissue.orientation, tissue.tension, pixels)[0])

    energies, others, errors, floor = [], [], [], []
    for number in range(len(tasks)):
        one, two, ours = singles[2 * number], singles[2 * number + 1], together[number]
        mean = 0.5 * (one.energy + two.energy)
        energies.append(ours.energy / mean - 1)
        others.append(abs(one.energy - two.energy) / mean)
        images = [density(tissue) for tissue in (one, two, ours)]
        errors.append(vrmse(images[2], images[0]))
        floor.append(vrmse(images[1], images[0]))
    return Agreement(
        moulds=len(tasks),
        energy=float(np.median(energies)),
        energy_of_seeds=float(np.median(others)),
        density_error=float(np.median(errors)),
        density_error_of_seeds=float(np.median(floor)),
        converged=sum(tissue.converged for tissue in together.values()),
        inverted=sum(tissue.inverted_fraction > 0 for tissue in together.values()),
    )


def time_design(
    tasks: list[Task], of: int, cast_seconds: float, model: NetworkModel, pixels: int, device: torch.device
) -> Timed:
    """Contract tasks and make their images."""
    started = time.perf_counter()
    made = [tissue for _, tissue in BatchSolver(tasks, model, "standard", device).run()]
    seconds = time.perf_counter() - started
    started = time.perf_counter()
    for tissue in made:
        rasterise_on(tissue.positions, tissue.orientation, tissue.tension, pixels, device)
    raster = time.perf_counter() - started
    evaluations = float(sum(tissue.gradient_evaluations * tissue.cells for tissue in made))
    return Timed(len(made), of, sum(t.cells for t in made), evaluations, cast_seconds, seconds, raster)


def limits(device: torch.device) -> dict[str, float]:
    """Bytes a second that copying moves, and operations a second of products of matrices, float32."""
    size = 2**28 if device.type == "cuda" else 2**24
    source = torch.ones(size, device=device)
    target = torch.empty_like(source)
    side = 8192 if device.type == "cuda" else 1024
    matrix = torch.ones(side, side, device=device)
    return {
        "bytes": 8 * size / seconds_of(lambda: target.copy_(source), device),
        "operations": 2.0 * side**3 / seconds_of(lambda: matrix @ matrix, device),
    }


def seconds_of(work: Callable[[], Any], device: torch.device, repeats: int = 5) -> float:
    """Seconds of one call, the best of some, a GPU's work waited for."""
    best = np.inf
    for _ in range(repeats + 1):  # the first one plans
        started = time.perf_counter()
        work()
        if device.type == "cuda":
            torch.cuda.synchronize(device)
        best = min(best, time.perf_counter() - started)
    return float(best)


def gradient_rate(tasks: list[Task], model: NetworkModel, device: torch.device) -> tuple[float, float]:
    """Directed bonds a second of energy and gradient, for as many of the tasks as fit; and bonds a cell."""
    room, chosen = room_for_cells(device), list[Task]()
    for task in tasks:
        room -= task.cast.blocks * BLOCK
        if room < 0 and chosen:
            break
        chosen.append(task)
    batch = build_batch([t.cast for t in chosen], [t.parameters for t in chosen], model, device)
    state = torch.cat([batch.sites, torch.ones_like(batch.sites)], dim=1)
    delta = torch.full((batch.tissues,), 0.5, dtype=torch.float64, device=device)
    contact = torch.zeros_like(delta)
    bonds = int((batch.neighbours >= 0).sum())
    rate = bonds / seconds_of(lambda: objective(batch, state, delta, contact), device)
    return rate, bonds / int(batch.cells.sum())


def prediction_seconds(architecture: Architecture, device: torch.device, batch: int) -> float:
    """Seconds a sample of the generator, in a batch, half precision on a GPU."""
    kind = torch.bfloat16 if device.type == "cuda" else torch.float32
    plain = Scaling((0.0,) * len(FIELDS), (1.0,) * len(FIELDS))
    generator = Generator(architecture, plain).to(device, kind).eval()
    size = architecture.pixels, architecture.pixels
    inputs = torch.randn(batch, len(INPUTS), *size, device=device, dtype=kind)
    with torch.no_grad():
        return seconds_of(lambda: generator(inputs, torch.ones(batch, device=device)), device) / batch


def _prepared(configuration: Configuration, count: int) -> tuple[list[Run], list[Mould]]:
    design = configuration.design(next(iter(configuration.campaigns)))
    edge = round(design.campaign.edge * count / design.campaign.runs)
    fewer = {"runs": count, "test": 1, "validation": 1, "edge": edge}
    return design.model_copy(update={"campaign": design.campaign.model_copy(update=fewer)}).make()


def _rows(found: dict[str, Any]) -> Iterator[tuple[str, str]]:
    a, t, rates, at_most = found["agreement"], found["design"], found["rates"], found["limits"]
    met = t["evaluations"] * rates["bonds_a_cell"]
    yield "energy against single runs, median of " + str(a["moulds"]), f"{100 * a['energy']:+.2f} %"
    yield "the same between two seeds", f"{100 * a['energy_of_seeds']:.2f} %"
    yield "density VRMSE against a single run", f"{a['density_error']:.3f}"
    yield "the same between two seeds", f"{a['density_error_of_seeds']:.3f}"
    yield "converged; inverted", f"{a['converged']} of {a['moulds']}; {a['inverted']}"
    yield f"{t['simulations']} of {t['of']} simulations, contracted", f"{t['seconds']:.1f} s"
    whole = t["seconds"] * t["of"] / t["simulations"]
    yield "all of them" + ("" if t["simulations"] == t["of"] else ", extrapolated"), f"{whole / 60:.1f} min"
    yield "their casting, on the processor", f"{t['cast_seconds']:.1f} s"
    yield "an image of eight fields", f"{1e3 * t['raster_seconds'] / t['simulations']:.2f} ms"
    yield "directed bonds a second, whole contraction", f"{met / t['seconds'] / 1e6:.1f} M"
    yield "directed bonds a second, gradient alone", f"{rates['bonds'] / 1e6:.1f} M"
    yield "of the measured arithmetic", f"{100 * rates['bonds'] * OPERATIONS / at_most['operations']:.1f} %"
    yield (
        "of the measured copying, caches left out",
        f"{100 * rates['bonds'] * BYTES / at_most['bytes']:.0f} %",
    )
    yield "training, samples a second", f"{rates['training']:.1f}"
    yield "prediction, ms a sample in a batch", f"{1e3 * rates['prediction']:.2f}"


def main(
    configuration: Annotated[Path, typer.Argument(help="configuration whose design is simulated")],
    output: Annotated[Path, typer.Option(help="JSON file of all numbers")],
    device: Annotated[str, typer.Option(help="auto, cpu or cuda")] = "auto",
    simulations: Annotated[
        int | None, typer.Option(min=2, help="of the design to time; all by default")
    ] = None,
    checked: Annotated[int, typer.Option(min=2, help="moulds held against single runs")] = 32,
    channels: Annotated[int, typer.Option(min=1, help="base channels of the network")] = 64,
    batch_size: Annotated[int, typer.Option(min=2, help="of training and prediction")] = 16,
) -> None:
    """Check and time the whole way of a configuration on one device."""
    rules, where = load(configuration), chosen_device(device)
    model, pixels = rules.network_model, rules.pixels
    of = rules.simulations(next(iter(rules.campaigns)))
    runs, moulds = _prepared(rules, simulations or of)
    # All that the processors do is done before a GPU is touched: processes are forked.
    started = time.perf_counter()
    casts = in_processes(_cast, [(mould, model) for mould in moulds])
    cast_seconds = time.perf_counter() - started
    tasks = [Task(m, c, r.parameters, r.seed) for m, c, r in zip(moulds, casts, runs, strict=True)]
    some = range(min(checked, len(runs)))
    singles = in_processes(_single, [(moulds[n], runs[n], model, seed) for n in some for seed in (1, 2)])

    at = torch.device(where)
    name = (
        torch.cuda.get_device_name(at) if where == "cuda" else f"{platform.machine()}, {os.cpu_count()} cores"
    )
    found: dict[str, Any] = {"device": name, "torch": torch.__version__, "configuration": str(configuration)}
    found["limits"] = limits(at)
    found["agreement"] = asdict(agreement([tasks[n] for n in some], singles, model, pixels, at))
    found["design"] = asdict(time_design(tasks, of, cast_seconds, model, pixels, at))
    architecture = published(pixels, channels)
    precision = "bfloat16" if where == "cuda" else "float32"
    training = TrainingRules(batch_size=batch_size, lambda_l1=100.0, precision=precision)
    bonds, bonds_a_cell = gradient_rate(tasks, model, at)
    found["rates"] = {
        "bonds": bonds,
        "bonds_a_cell": bonds_a_cell,
        "training": examples_a_second(architecture, training, where, 20 if where == "cuda" else 2),
        "prediction": prediction_seconds(architecture, at, batch_size),
    }
    with atomic_path(output) as temporary:
        temporary.write_text(json.dumps(found, indent=1) + "\n")
    table = Table(title=f"{configuration} on {name}")
    for head in ("what", "measured"):
        table.add_column(head, justify="left" if head == "what" else "right")
    for row in _rows(found):
        table.add_row(*row)
    CONSOLE.print(table)


def _cast(job: tuple[Mould, NetworkModel]) -> Any:
    return cast(*job)


if __name__ == "__main__":
    typer.run(main)
