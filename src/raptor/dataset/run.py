"""Simulation of the runs of a design, on the processor or on a GPU."""

import logging
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import TYPE_CHECKING

import numpy as np

from raptor.condor.accuracy import accuracy_named
from raptor.condor.simulate import Tissue, simulate
from raptor.core.errors import RaptorError
from raptor.core.jobs import processors
from raptor.dataset.design import Run
from raptor.moulds.geometry import Mould
from raptor.parameters import NetworkModel

if TYPE_CHECKING:
    from raptor.condor.gpu.layout import Cast

log = logging.getLogger("raptor")

FEW = 16  # largest number of runs cast in a single process


def simulate_shard(
    runs: list[Run],
    moulds: dict[str, Mould],
    model: NetworkModel,
    accuracy: str,
    device: str = "cpu",
    on_progress: Callable[[Run, Tissue | str], None] = lambda run, outcome: None,
) -> tuple[dict[int, Tissue], dict[int, str]]:
    """Simulate runs; returns simulations and reasons of failure, by id.

    One after another on the processor; many at once on a GPU, if the accuracy only contracts. A run that
    fails is tried once more on the processor and then given up, and the others continue. Lack of memory or
    disk is not a fault of a run and is raised, so that the workflow tries the whole shard again.
    `on_progress` gets each run's simulation or the reason for its failure.
    """
    simulations, failures = {}, {}
    if device != "cpu" and accuracy_named(accuracy).contracts_alone:
        simulations = _simulate_together(runs, moulds, model, accuracy, device, on_progress)
    for run in runs:
        if run.simulation in simulations:
            continue
        outcome = _simulate(run, moulds, model, accuracy)
        if isinstance(outcome, str):  # once more: the cause may be transient
            outcome = _simulate(run, moulds, model, accuracy)
        if isinstance(outcome, str):
            failures[run.simulation] = outcome
        else:
            simulations[run.simulation] = outcome
        on_progress(run, outcome)
    return simulations, failures


def _simulate(run: Run, moulds: dict[str, Mould], model: NetworkModel, accuracy: str) -> Tissue | str:
    """The simulation of a run, or why it failed."""
    try:
        made = simulate(moulds[run.mould], run.parameters, model, accuracy, run.seed)
    except (RaptorError, ArithmeticError, np.linalg.LinAlgError) as error:
        log.exception("simulation %d failed", run.simulation)
        return f"{type(error).__name__}: {error}"
    if not _is_finite(made):
        return "the solver met NaN or infinity"
    return made


def _simulate_together(
    runs: list[Run],
    moulds: dict[str, Mould],
    model: NetworkModel,
    accuracy: str,
    device: str,
    on_progress: Callable[[Run, Tissue | str], None],
) -> dict[int, Tissue]:
    """Simulations of runs in one batch, by id, without those that cannot be cast or do not stay finite."""
    import torch  # here, because jobs on the processor do without it

    from raptor.condor.gpu.contract import BatchSolver, Task

    found = zip(runs, _cast_all([moulds[run.mould] for run in runs], model), strict=True)
    cast = [(run, tissue) for run, tissue in found if tissue is not None]
    tasks = [Task(moulds[run.mould], tissue, run.parameters, run.seed) for run, tissue in cast]
    simulations = {}
    for number, simulation in BatchSolver(tasks, model, accuracy, torch.device(device)).run():
        run = cast[number][0]
        if _is_finite(simulation):
            simulations[run.simulation] = simulation
            on_progress(run, simulation)
    return simulations


def _cast_all(moulds: list[Mould], model: NetworkModel) -> list["Cast | None"]:
    """Moulds cast for a batch, None for those that cannot be; in parallel, before the GPU is used."""
    if len(moulds) <= FEW:
        return [_cast(mould, model) for mould in moulds]
    with ProcessPoolExecutor(processors(), get_context("fork")) as pool:
        return list(pool.map(_cast, moulds, [model] * len(moulds), chunksize=8))


def _cast(mould: Mould, model: NetworkModel) -> "Cast | None":
    from raptor.condor.gpu.layout import cast

    try:
        return cast(mould, model)
    except RaptorError:
        return None  # recorded when the processor tries again


def _is_finite(simulation: Tissue) -> bool:
    return bool(np.isfinite(simulation.energy) and np.isfinite(simulation.positions).all())
