"""Minimisers and preconditioners side by side, and how the time of a run grows with its cells."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import fmin_l_bfgs_b
from scipy.sparse.linalg import spilu, splu

from raptor.condor.contract import steps_to
from raptor.condor.energy import _objective_kernel, scratch, unit_orientations
from raptor.condor.minimise import (
    BACKTRACKS,
    MAX_STEP,
    MAX_TURN,
    MEMORY,
    SUFFICIENT,
    minimise,
    orientation_lever,
)
from raptor.condor.simulate import simulate
from raptor.condor.system import System, build_system, cast_state
from raptor.moulds.geometry import Circle, Mould
from raptor.parameters import CellParameters, NetworkModel

Array = NDArray[np.float64]
Inverse = Callable[[Array], Array]
SHIFT = 1e-3  # of the elastic stiffness, kappa0: what holds a gel without tethers
GRID = 4.0  # spacing of the coarse grid, l0


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


def preconditioners(system: System, state: Array) -> dict[str, Inverse]:
    """Approximate inverses of the network's elastic stiffness, for displacements (3 * cells,)."""
    stiffness = elastic_stiffness(system, state)
    diagonal = stiffness.diagonal()
    complete, incomplete = splu(stiffness), spilu(stiffness, drop_tol=1e-2, fill_factor=3)
    coarse = _coarse_grid(system.lattice.sites)
    coarse_solve = splu(sparse.csc_matrix(coarse.T @ stiffness @ coarse))
    return {
        "none": lambda force: force,
        "diagonal": lambda force: force / diagonal,
        "incomplete factorisation": incomplete.solve,
        "two grids": lambda force: force / diagonal + coarse @ coarse_solve.solve(coarse.T @ force),
        "complete factorisation": complete.solve,
    }


def elastic_stiffness(system: System, state: Array) -> sparse.csc_matrix:
    """Sum over bonds of k u u^T, (3 * cells, 3 * cells), and a small shift; kappa0."""
    lattice, n = system.lattice, system.lattice.cells
    positions = state[: 3 * n].reshape(3, -1)
    u = positions[:, lattice.second] - positions[:, lattice.first]
    u /= np.linalg.norm(u, axis=0)
    rows, columns, values = [], [], []
    for a in range(3):
        for b in range(3):
            block = lattice.stiffness * u[a] * u[b]
            for i, j, sign in (
                (lattice.first, lattice.first, 1), (lattice.second, lattice.second, 1),
                (lattice.first, lattice.second, -1), (lattice.second, lattice.first, -1),
            ):  # fmt: skip
                rows.append(a * n + i)
                columns.append(b * n + j)
                values.append(sign * block)
    index = np.concatenate(rows), np.concatenate(columns)
    matrix = sparse.csc_matrix((np.concatenate(values), index), shape=(3 * n, 3 * n))
    return sparse.csc_matrix(matrix + SHIFT * sparse.identity(3 * n))


def _coarse_grid(sites: Array) -> sparse.csc_matrix:
    """Displacements of all cells, linear within squares of a coarse grid in the plane."""
    corner = np.floor((sites[:, :2] - sites[:, :2].min(axis=0)) / GRID).astype(int)
    part = (sites[:, :2] - sites[:, :2].min(axis=0)) / GRID - corner
    shape = corner.max(axis=0) + 2
    parts = []
    for dx in (0, 1):
        for dy in (0, 1):
            weight = np.abs(1 - dx - part[:, 0]) * np.abs(1 - dy - part[:, 1])
            node = (corner[:, 0] + dx) * shape[1] + corner[:, 1] + dy
            parts.append(
                sparse.csc_matrix((weight, (np.arange(len(sites)), node)), (len(sites), shape.prod()))
            )
    plane = sparse.csc_matrix(sum(parts[1:], parts[0]))
    return sparse.csc_matrix(sparse.block_diag([plane[:, plane.getnnz(axis=0) > 0]] * 3))


@dataclass(frozen=True)
class Preconditioned:
    """Energies after so many evaluations with a preconditioner, and the cost of applying it once."""

    name: str
    energies: list[float]
    milliseconds: float


def compare_preconditioners(
    mould: Mould,
    parameters: CellParameters,
    model: NetworkModel,
    at: tuple[int, ...] = (25, 50, 100, 200, 400),
) -> Iterator[Preconditioned]:
    """One step of a contraction by the same L-BFGS with different preconditioners."""
    system, state, delta = contraction_step(mould, parameters, model)
    force = np.random.default_rng(0).normal(size=3 * system.lattice.cells)
    for name, inverse in preconditioners(system, state).items():
        energies = _preconditioned_lbfgs(system, state, delta, inverse, max(at))
        started = time.perf_counter()
        for _ in range(5):
            inverse(force)
        milliseconds = (time.perf_counter() - started) / 5 * 1e3
        yield Preconditioned(name, [energies[min(n, len(energies)) - 1] for n in at], milliseconds)


def _preconditioned_lbfgs(
    system: System, state: Array, delta: float, inverse: Inverse, evaluations: int
) -> list[float]:
    """Least energy after each evaluation, by an L-BFGS like `minimise` in NumPy that halves steps."""
    lever = orientation_lever(delta)
    evaluate, x = _scaled_objective(system, delta), _scaled(state, lever)
    half = x.size // 2
    energy, g = evaluate(x)
    history = [energy]
    pairs: list[tuple[Array, Array]] = []
    while len(history) < evaluations:
        d = -_two_loops(g, pairs, inverse)
        if d @ g >= 0:
            pairs = []
            d = -_two_loops(g, pairs, inverse)
        turn = np.abs(d[half:]).max() / lever
        longest = min(MAX_STEP / np.abs(d[:half]).max(), MAX_TURN / turn)
        length = min(1.0 if pairs else 0.1 * longest, longest)
        for _ in range(BACKTRACKS):
            trial = x + length * d
            trial_energy, trial_g = evaluate(trial)
            history.append(min(history[-1], trial_energy))
            if trial_energy <= energy + SUFFICIENT * length * (d @ g):
                break
            length *= 0.5
        else:
            if not pairs:
                break
            pairs = []
            continue
        s, y = trial - x, trial_g - g
        x, energy, g = trial, trial_energy, trial_g
        if s @ y > 1e-10 * (y @ y):
            pairs = [*pairs[1 - MEMORY :], (s, y)]
    return history[:evaluations]


def _two_loops(g: Array, pairs: list[tuple[Array, Array]], inverse: Inverse) -> Array:
    """Inverse Hessian times g, with the preconditioner on displacements in its middle."""
    q, half = g.copy(), g.size // 2
    alphas = []
    for s, y in reversed(pairs):
        alphas.append(s @ q / (s @ y))
        q -= alphas[-1] * y

    def middle(vector: Array) -> Array:
        return np.concatenate([inverse(vector[:half]), vector[half:]])

    r = middle(q)
    if pairs:
        s, y = pairs[-1]
        r *= (s @ y) / (y @ middle(y))
    for (s, y), alpha in zip(pairs, reversed(alphas), strict=True):
        r += (alpha - y @ r / (s @ y)) * s
    return r


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
