"""Energy of the contractile network, its gradient, and what follows from a bond's stretch.

For a bond of stiffness k, rest length L, length |l| and direction u between cells of orientation
s_i and s_j (paper, equations 1 and 2):

    L' = L (1 - Delta/2 (2 - (u.s_i)^2 - (u.s_j)^2)),     E = k/2 (|l| - L')^2.

A state is one array of 6 blocks of `cells` numbers: x, y, z, and the three components of a vector
along the orientation, whose length does not matter; s and -s are the same cell.
"""

import math

import numpy as np
from numpy.typing import NDArray

from raptor.compiled import kernel
from raptor.condor.lanes import LANES, add_lanes, copy_lanes, subtract_lanes
from raptor.condor.lattice import Lattice
from raptor.condor.network import CHUNKS, WIDTH, Network
from raptor.condor.walls import Walls, wall_energy
from raptor.errors import RaptorError

SOFTENING = 1e-12  # l0^2, added to |l|^2: two cells on top of each other keep a finite force
ROWS = 21  # of a block's buffer: 12 read, 9 written
BUFFER = ROWS * WIDTH


def natural_length(rest_length, delta, along_first, along_second):
    """L': length at which a bond is at rest, given u.s_i and u.s_j (paper, equation 2), l0."""
    return rest_length * (1 - delta / 2 * (2 - along_first**2 - along_second**2))


natural_length_kernel = kernel(natural_length)


@kernel
def _block_kernel(b, stiffness, rest, delta):
    """Energy of the WIDTH bonds in a buffer; writes their forces into it.

    Rows of b: positions and orientations of the first cells (0 to 5) and the second (6 to 11);
    written: dE/dl (12 to 14), dE/ds of the first (15 to 17) and of the second cell (18 to 20).
    Indices are unsigned: only then does the compiler use vector instructions here.
    """
    half = 0.5 * rest * delta
    base = rest * (1.0 - delta)
    energy = 0.0
    w = np.uint64(WIDTH)
    for lane in range(WIDTH):
        t = np.uint64(lane)
        ax, ay, az = b[t + np.uint64(3) * w], b[t + np.uint64(4) * w], b[t + np.uint64(5) * w]
        cx, cy, cz = b[t + np.uint64(9) * w], b[t + np.uint64(10) * w], b[t + np.uint64(11) * w]
        lx = b[t + np.uint64(6) * w] - b[t]
        ly = b[t + np.uint64(7) * w] - b[t + w]
        lz = b[t + np.uint64(8) * w] - b[t + np.uint64(2) * w]
        length = math.sqrt(lx * lx + ly * ly + lz * lz + SOFTENING)
        inverse = 1.0 / length
        ux, uy, uz = lx * inverse, ly * inverse, lz * inverse
        first = ux * ax + uy * ay + uz * az
        second = ux * cx + uy * cy + uz * cz
        squares = first * first + second * second
        stretch = length - base - half * squares
        tension = stiffness[t] * stretch
        energy += tension * stretch
        # dL'/du = 2 half (first s_i + second s_j), and du/dl = (1 - u u^T) / |l|.
        turn = -2.0 * half * tension * inverse
        along = tension - turn * squares
        first *= turn
        second *= turn
        b[t + np.uint64(12) * w] = along * ux + first * ax + second * cx
        b[t + np.uint64(13) * w] = along * uy + first * ay + second * cy
        b[t + np.uint64(14) * w] = along * uz + first * az + second * cz
        first *= length
        second *= length
        b[t + np.uint64(15) * w] = first * ux
        b[t + np.uint64(16) * w] = first * uy
        b[t + np.uint64(17) * w] = first * uz
        b[t + np.uint64(18) * w] = second * ux
        b[t + np.uint64(19) * w] = second * uy
        b[t + np.uint64(20) * w] = second * uz
    return 0.5 * energy


@kernel
def _copy_kernel(state, cells, network, block, b):
    """Copy both ends of a block's bonds into its buffer."""
    for c in range(CHUNKS):
        first = network.chunk_first[block * CHUNKS + c]
        second = network.chunk_second[block * CHUNKS + c]
        for row in range(6):
            copy_lanes(b, row * WIDTH + c * LANES, state, row * cells + first)
            copy_lanes(b, (row + 6) * WIDTH + c * LANES, state, row * cells + second)


@kernel
def _add_kernel(gradient, cells, network, block, b):
    """Add a block's forces to the gradient of both ends of its bonds."""
    for c in range(CHUNKS):
        first = network.chunk_first[block * CHUNKS + c]
        second = network.chunk_second[block * CHUNKS + c]
        slot = c * LANES
        for row in range(3):
            subtract_lanes(gradient, row * cells + first, b, (row + 12) * WIDTH + slot)
            add_lanes(gradient, row * cells + second, b, (row + 12) * WIDTH + slot)
            add_lanes(gradient, (row + 3) * cells + first, b, (row + 15) * WIDTH + slot)
            add_lanes(gradient, (row + 3) * cells + second, b, (row + 18) * WIDTH + slot)


@kernel
def _objective_kernel(state, gradient, network, walls, delta, unit, force, buffer):
    """Bond energy and wall energy of a state; fills its gradient.

    `unit` and `force` are scratch, LANES longer than the state: lanes without a bond read and add
    zeros a little past the last cell.
    """
    cells = state.size // 6
    for i in range(3 * cells):
        unit[i] = state[i]
    for i in range(cells):
        a, b, c = state[3 * cells + i], state[4 * cells + i], state[5 * cells + i]
        inverse = 1.0 / math.sqrt(a * a + b * b + c * c)
        unit[3 * cells + i] = a * inverse
        unit[4 * cells + i] = b * inverse
        unit[5 * cells + i] = c * inverse
    force[:] = 0.0
    energy = 0.0
    for block in range(network.block_rest.size):
        _copy_kernel(unit, cells, network, block, buffer)
        lanes = network.stiffness[block * WIDTH : (block + 1) * WIDTH]
        energy += _block_kernel(buffer, lanes, network.block_rest[block], delta)
        _add_kernel(force, cells, network, block, buffer)
    walled = 0.0
    for i in range(cells):
        wall, wx, wy, wz = wall_energy(state[i], state[cells + i], state[2 * cells + i], walls)
        walled += wall
        gradient[i] = force[i] + wx
        gradient[cells + i] = force[cells + i] + wy
        gradient[2 * cells + i] = force[2 * cells + i] + wz
        # dE/ds of a unit vector, as seen by a vector of any length along it.
        a, b, c = unit[3 * cells + i], unit[4 * cells + i], unit[5 * cells + i]
        ga, gb, gc = force[3 * cells + i], force[4 * cells + i], force[5 * cells + i]
        along = ga * a + gb * b + gc * c
        x, y, z = state[3 * cells + i], state[4 * cells + i], state[5 * cells + i]
        inverse = 1.0 / (a * x + b * y + c * z)
        gradient[3 * cells + i] = (ga - along * a) * inverse
        gradient[4 * cells + i] = (gb - along * b) * inverse
        gradient[5 * cells + i] = (gc - along * c) * inverse
    return energy, walled


@kernel
def _stretch_kernel(state, first, second, stiffness, rest, delta, hooke, tension):
    """Sum over each cell's bonds of the tension, for unit orientations."""
    cells = tension.size
    for bond in range(first.size):
        i, j = first[bond], second[bond]
        squared = SOFTENING
        for c in range(3):
            squared += (state[c * cells + j] - state[c * cells + i]) ** 2
        length = math.sqrt(squared)
        along_first = along_second = 0.0
        for c in range(3):
            u = (state[c * cells + j] - state[c * cells + i]) / length
            along_first += u * state[(c + 3) * cells + i]
            along_second += u * state[(c + 3) * cells + j]
        natural = natural_length_kernel(rest[bond], delta, along_first, along_second)
        value = stiffness[bond] * (length - natural if hooke else natural)
        tension[i] += value
        tension[j] += value


def scratch(cells: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Arrays that one evaluation works in, to be made once for many."""
    return np.zeros(6 * cells + LANES), np.zeros(6 * cells + LANES), np.zeros(BUFFER)


def objective(
    state: NDArray[np.float64], network: Network, walls: Walls, delta: float
) -> tuple[float, float, NDArray[np.float64]]:
    """Energy of the bonds, energy of the walls (kappa0 l0^2) and gradient (6 * cells,) of their sum.

    Parameters
    ----------
    state : ndarray (6 * cells,)
        x, y, z (l0) and a vector along each orientation.

    Raises
    ------
    RaptorError
        Where the state does not fit the network or holds an orientation of length zero.
    """
    cells = len(network.start) - 1
    if state.shape != (6 * cells,):
        raise RaptorError(f"state has shape {state.shape}; (6 * {cells},) is expected")
    if (np.linalg.norm(state[3 * cells :].reshape(3, -1), axis=0) == 0).any():
        raise RaptorError("a cell's orientation has length zero; give each a direction")
    gradient = np.empty_like(state)
    energy, walled = _objective_kernel(state, gradient, network, walls, delta, *scratch(cells))
    return float(energy), float(walled), gradient


def cell_tension(
    state: NDArray[np.float64], lattice: Lattice, delta: float, kind: str = "hooke"
) -> NDArray[np.float64]:
    """Mean tension of each cell's bonds, (cells,), kappa0 l0; zero for a cell without bonds.

    `kind` is "hooke", k (|l| - L'), or "literal", k L' (paper, after equation 2).
    """
    total = np.zeros(lattice.cells)
    _stretch_kernel(
        unit_orientations(state),
        lattice.first,
        lattice.second,
        lattice.stiffness,
        lattice.rest_length,
        delta,
        kind == "hooke",
        total,
    )
    return total / np.maximum(coordination(lattice), 1)


def coordination(lattice: Lattice) -> NDArray[np.int64]:
    """Number of bonds of each cell, (cells,)."""
    ends = np.concatenate([lattice.first, lattice.second])
    return np.bincount(ends, minlength=lattice.cells)


def folded_fraction(state: NDArray[np.float64], lattice: Lattice) -> float:
    """Share of bonds whose direction has reversed since casting; 0 without bonds."""
    if lattice.bonds == 0:
        return 0.0
    positions = state[: 3 * lattice.cells].reshape(3, -1).T
    cast = lattice.sites[lattice.second] - lattice.sites[lattice.first]
    now = positions[lattice.second] - positions[lattice.first]
    return float(np.mean(np.einsum("bc,bc->b", cast, now) < 0))


def unit_orientations(state: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same state with orientations of length one."""
    unit = state.copy()
    orientations = unit[state.size // 2 :].reshape(3, -1)
    orientations /= np.linalg.norm(orientations, axis=0)
    return unit
