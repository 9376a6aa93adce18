"""Minimisers side by side, and how the time of a run grows with its cells."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.optimize import fmin_l_bfgs_b

from raptor.condor.contract import steps_to
from raptor.condor.energy import _objective_kernel, scratch, unit_orientations
from raptor.condor.minimise import MEMORY, minimise, orientation_lever
from raptor.condor.simulate import simulate
from raptor.condor.system import System, build_system, cast_state
from raptor.moulds.geometry import Circle, Mould
from raptor.parameters import CellParameters, NetworkModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Minimised:
    """What a minimiser reached, in how many evaluations and seconds."""

    name: str
    energy: float
    evaluations: int
    seconds: float


def contraction_step(
    mould: Mould, parameters: CellParameters, model: NetworkModel
) -> tuple[System, Array, float]:
    """A system, the state half-way through its contraction, and the next Delta."""
    system = build_system(mould, parameters, model)
    state = cast_state(system.lattice.sites, np.random.default_rng(0))
    path = steps_to(parameters.delta, 0.1)
    middle = len(path) // 2
    for delta in path[:middle]:
        state = minimise(
            state, system.network, system.walls, delta, tolerance=1e-2, max_evaluations=200
        ).state
    return system, state, float(path[middle])


def against_scipy(
    mould: Mould, parameters: CellParameters, model: NetworkModel, evaluations: int = 500
) -> Iterator[Minimised]:
    """Our minimiser and SciPy's L-BFGS-B on the same gradient, from the same state."""
    system, state, delta = contraction_step(mould, parameters, model)
    minimise(state, system.network, system.walls, delta, tolerance=0.0, max_evaluations=2)
    started = time.perf_counter()
    found = minimise(state, system.network, system.walls, delta, tolerance=0.0, max_evaluations=evaluations)
    yield Minimised(
        "ours", found.energy + found.wall_energy, found.evaluations, time.perf_counter() - started
    )
    evaluate = _scaled_objective(system, delta)
    start = _scaled(state, orientation_lever(delta))
    started = time.perf_counter()
    _, energy, told = fmin_l_bfgs_b(
        evaluate, start, m=MEMORY, factr=0, pgtol=0, maxfun=evaluations, maxiter=evaluations
    )
    yield Minimised("SciPy L-BFGS-B", float(energy), told["funcalls"], time.perf_counter() - started)


def _scaled(state: Array, lever: float) -> Array:
    scaled = unit_orientations(state)
    scaled[scaled.size // 2 :] *= lever
    return scaled


def _scaled_objective(system: System, delta: float) -> Callable[[Array], tuple[float, Array]]:
    """The kernel that `minimise` calls, with arrays made once, as SciPy calls it."""
    work = scratch(system.lattice.cells)

    def evaluate(state: Array) -> tuple[float, Array]:
        gradient = np.empty_like(state)
        energy, wall_energy = _objective_kernel(
            state, gradient, system.network, system.walls, delta, 0.0, work
        )
        return energy + wall_energy, gradient

    return evaluate


def posted_rectangle(cells: int) -> tuple[Mould, int]:
    """A rectangle of 2:1 with four posts that holds about so many cells, and its layers."""
    layers = max(2, round((cells / 3500) ** (1 / 3) * 5))
    width = np.sqrt(2 * cells / layers)
    if width > 60:
        width, layers = 60.0, round(cells / 1800)
    x, y = width / 2, width / 4
    posts = tuple(Circle(sx * (x - 3), sy * (y - 3), 1.0) for sx in (-1, 1) for sy in (-1, 1))
    return Mould(shapely.box(-x, -y, x, y), posts, name=f"rectangle_{cells}"), layers


@dataclass(frozen=True)
class Scaling:
    """One run's size and cost."""

    cells: int
    seconds: float
    evaluations: int


def time_against_cells(
    sizes: tuple[int, ...], parameters: CellParameters, seeds: int = 3
) -> Iterator[Scaling]:
    """Median processor time of `standard` runs of growing moulds."""
    for size in sizes:
        mould, layers = posted_rectangle(size)
        runs = []
        for seed in range(seeds):
            started = time.process_time()
            tissue = simulate(mould, parameters, NetworkModel(layers), "standard", seed)
            runs.append((time.process_time() - started, tissue.gradient_evaluations))
        seconds, evaluations = np.median(runs, axis=0)
        yield Scaling(tissue.cells, float(seconds), int(evaluations))
