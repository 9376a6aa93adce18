"""Rates of the gradient and of trial moves against baselines, and against the machine's bound."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from benchmarks.baselines import (
    gradient_by_bonds,
    gradient_by_neighbours,
    metropolis_sweep,
    neighbour_table,
    torch_gradient,
)
from benchmarks.machine import arithmetic_rate, copy_rate, root_rate, seconds
from raptor.condor.anneal import anneal
from raptor.condor.energy import _objective_kernel, scratch
from raptor.condor.lattice import Lattice
from raptor.condor.simd import lanes
from raptor.condor.system import System, build_system, cast_state
from raptor.core.errors import RaptorError
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters, NetworkModel

OPERATIONS = 74  # multiplications and additions of a bond in `_bonds_kernel`, and one 1 / sqrt
MOVED = 18  # numbers of a bond that are read or written there
SWEEPS = 20


@dataclass(frozen=True)
class Rate:
    """How fast one way of doing a thing is: bonds (from both ends) or trial moves a second."""

    name: str
    rate: float


def disturbed_state(lattice: Lattice) -> NDArray[np.float64]:
    """A cast state with some noise, so that no bond is at rest."""
    rng = np.random.default_rng(0)
    state = cast_state(lattice.sites, rng)
    state[: 3 * lattice.cells] += 0.05 * rng.normal(size=3 * lattice.cells)
    return state


def gradient_rates(mould: Mould, parameters: CellParameters, model: NetworkModel) -> Iterator[Rate]:
    """Directed bonds a second of energy and gradient, walls included in ours alone.

    Raises
    ------
    RaptorError
        Where a baseline does not compute the same energy.
    """
    delta = parameters.delta
    system = build_system(mould, parameters, model)
    lattice = system.lattice
    bonds = 2 * lattice.bonds
    state, gradient = disturbed_state(lattice), np.empty(6 * lattice.cells)
    table = neighbour_table(lattice)
    bond_list = (lattice.first, lattice.second, lattice.stiffness, lattice.rest_length)
    energy = _evaluate(state, system, delta)
    torch_evaluate = torch_gradient(lattice, delta)
    others = {
        "table of neighbours, float64": lambda: gradient_by_neighbours(state, gradient, table, delta),
        "list of bonds, float64": lambda: gradient_by_bonds(state, gradient, *bond_list, delta),
        "torch autograd, float64, one thread": lambda: torch_evaluate(state)[0],
    }
    torch.set_num_threads(1)
    for name, work in others.items():
        if not np.isclose(work(), energy, rtol=1e-9):
            raise RaptorError(f"{name}: {work()} is not the energy {energy}")
        yield Rate(name, bonds / seconds(work))
    yield Rate("vector registers, float64", bonds / _seconds_of_gradient(state, system, delta))
    single = build_system(mould, parameters, model, np.float32)
    time = _seconds_of_gradient(state.astype(np.float32), single, delta)
    yield Rate("vector registers, float32", bonds / time)


def _evaluate(state: NDArray[Any], system: System, delta: float) -> float:
    work = scratch(system.lattice.cells, state.dtype)
    energy, _ = _objective_kernel(state, np.empty_like(state), system.network, system.walls, delta, 0.0, work)
    return float(energy)


def _seconds_of_gradient(state: NDArray[Any], system: System, delta: float) -> float:
    gradient, work = np.empty_like(state), scratch(system.lattice.cells, state.dtype)
    return seconds(lambda: _objective_kernel(state, gradient, system.network, system.walls, delta, 0.0, work))


def trial_rates(mould: Mould, parameters: CellParameters, model: NetworkModel) -> Iterator[Rate]:
    """Trial moves a second at one temperature; ours with walls and proposals that adapt."""
    delta, temperature = parameters.delta, 1e-3
    lattice = build_system(mould, parameters, model).lattice
    state, table = cast_state(lattice.sites, np.random.default_rng(0)), neighbour_table(lattice)
    rng = np.random.default_rng(0)

    def plain() -> None:
        for _ in range(SWEEPS):
            metropolis_sweep(state, table, delta, temperature, 0.03, 0.1, rng)

    yield Rate("plain loop, float64", SWEEPS * lattice.cells / seconds(plain))
    for precision in (np.float64, np.float32):
        system = build_system(mould, parameters, model, precision)
        start = cast_state(lattice.sites, np.random.default_rng(0)).astype(precision)

        def ours(system: System = system, start: NDArray[Any] = start) -> None:
            anneal(
                start, system.order, system.sublattices, system.walls, delta, rng,
                sweeps=SWEEPS, initial_temperature=temperature, temperature_factor=1.0,
            )  # fmt: skip

        name = f"vector registers, {np.dtype(precision).name}"
        yield Rate(name, SWEEPS * lattice.cells / seconds(ours))


@dataclass(frozen=True)
class Bound:
    """How many directed bonds a second one of the machine's rates would allow."""

    what: str
    machine: str
    rate: float


def bounds(system: System, precision: Any) -> list[Bound]:
    """The machine's bounds on the gradient's rate, in directed bonds a second.

    Operations are counted for all lanes, also those that hold no bond.
    """
    filled = system.lattice.bonds / (len(system.network.bits) * lanes(precision))
    arithmetic, roots = arithmetic_rate(precision), root_rate(precision)
    moved = MOVED * np.dtype(precision).itemsize
    size = 2 * 6 * system.lattice.cells * np.dtype(precision).itemsize  # state and forces
    copied = copy_rate(size)
    return [
        Bound("multiply and add", f"{arithmetic / 1e9:.1f} G/s", 2 * filled * arithmetic / OPERATIONS),
        Bound("1 / sqrt", f"{roots / 1e9:.2f} G/s", 2 * filled * roots),
        Bound(
            f"moves of {moved} bytes a bond",
            f"{copied / 1e9:.0f} GB/s at {size // 1000} kB",
            2 * filled * copied / moved,
        ),
    ]
