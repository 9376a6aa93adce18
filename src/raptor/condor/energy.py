"""Energy of the contractile network, its gradient, tension and inverted bonds.

For a bond of stiffness k, rest length L, length |l| and direction u between cells of orientation
s_i and s_j (paper, equations 1 and 2):

    L' = L (1 - Delta/2 (2 - (u.s_i)^2 - (u.s_j)^2)),     E = k/2 (|l| - L')^2.

Springs do not stop matter from passing through itself. An optional **contact** repels the ends of a bond
that are nearer than a hundredth of its rest length along its direction at casting, as a wall repels a cell.

A state is one array of 6 blocks of `cells` numbers: x, y, z, and the three components of a vector
along the orientation, of any length; s and -s are the same cell.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import DTypeLike, NDArray

from raptor.condor.lattice import Lattice
from raptor.condor.network import Network
from raptor.condor.simd import dot, lanes, load, muladd, positive, sqrt, store, total, where
from raptor.condor.walls import Walls, near_kernel, wall_energy_kernel
from raptor.core.compiled import kernel
from raptor.core.errors import RaptorError

SOFTENING = 1e-12  # l0^2, added to |l|^2, so that coincident cells have a finite force
CONTACT_LENGTH = 0.01  # of a bond's rest length
SMALLEST_LEVER = 0.02  # l0; for Delta near 0


@register_jitable
def natural_length(rest_length, delta, squares):
    """Length at which a bond is at rest, L' = L (1 - Delta/2 (2 - squares)) (paper, equation 2), l0.

    `squares` is (u.s_i)^2 + (u.s_j)^2. For numbers, vector lanes, arrays and tensors.
    """
    return muladd(0.5 * rest_length * delta, squares, rest_length * (1 - delta))


class Scratch(NamedTuple):
    """Arrays that evaluations work in, to be made once for many: 6 rows with room on both sides.

    Lanes that hold no bond read, and add zeros, a little before the first cell and after the last.
    """

    unit: NDArray[Any]
    force: NDArray[Any]


def scratch(cells: int, precision: DTypeLike = np.float64) -> Scratch:
    """Work arrays for evaluations of a number of cells."""
    size = 6 * cells + 2 * lanes(precision)
    return Scratch(np.zeros(size, precision), np.zeros(size, precision))


@kernel
def _bonds_kernel(cells, network, delta, contact, work):
    """Energy of all bonds and contacts of the unit state; adds -dE/dx and dE/ds to the forces."""
    unit, force = work.unit, work.force
    n, room = cells, (unit.size - 6 * cells) // 2
    energy = touching = 0.0
    for chunk in range(network.first.size):
        i = network.first[chunk] + room
        x, y, z = load(unit, i), load(unit, i + n), load(unit, i + 2 * n)
        ax, ay, az = load(unit, i + 3 * n), load(unit, i + 4 * n), load(unit, i + 5 * n)
        zero = x * 0.0
        fx, fy, fz, tx, ty, tz, double, close = zero, zero, zero, zero, zero, zero, zero, zero
        for entry in range(network.entries[chunk], network.entries[chunk + 1]):
            j = network.second[entry] + room
            kind = network.kind[entry]
            stiffness = where(network.bits[entry], network.stiffness[kind], x)
            rest_length = network.rest_length[kind]
            lx, ly, lz = load(unit, j) - x, load(unit, j + n) - y, load(unit, j + 2 * n) - z
            bx, by, bz = load(unit, j + 3 * n), load(unit, j + 4 * n), load(unit, j + 5 * n)
            squared = dot(lx, lx, ly, ly, lz, lz) + SOFTENING
            inverse = 1.0 / sqrt(squared)
            ux, uy, uz = lx * inverse, ly * inverse, lz * inverse
            first, second = dot(ux, ax, uy, ay, uz, az), dot(ux, bx, uy, by, uz, bz)
            squares = muladd(first, first, second * second)
            stretch = squared * inverse - natural_length(rest_length, delta, squares)
            tension = stiffness * stretch
            double = muladd(tension, stretch, double)
            # dL'/du = L Delta (first s_i + second s_j), and du/dl = (1 - u u^T) / |l|.
            twist = -delta * rest_length * tension
            turn = twist * inverse
            along = tension - turn * squares
            by_first, by_second = turn * first, turn * second
            px = dot(along, ux, by_first, ax, by_second, bx)
            py = dot(along, uy, by_first, ay, by_second, by)
            pz = dot(along, uz, by_first, az, by_second, bz)
            if contact > 0.0:
                dx, dy, dz = network.direction[kind]
                ahead = dot(lx, dx, ly, dy, lz, dz)
                push = positive(CONTACT_LENGTH * rest_length - ahead)
                push = push * where(network.bits[entry], contact, x)
                close = muladd(push, push, close)
                px, py, pz = px - push * dx, py - push * dy, pz - push * dz
            fx, fy, fz = fx + px, fy + py, fz + pz
            first, second = first * twist, second * twist
            tx, ty, tz = muladd(first, ux, tx), muladd(first, uy, ty), muladd(first, uz, tz)
            store(force, j, load(force, j) - px)
            store(force, j + n, load(force, j + n) - py)
            store(force, j + 2 * n, load(force, j + 2 * n) - pz)
            store(force, j + 3 * n, muladd(second, ux, load(force, j + 3 * n)))
            store(force, j + 4 * n, muladd(second, uy, load(force, j + 4 * n)))
            store(force, j + 5 * n, muladd(second, uz, load(force, j + 5 * n)))
        store(force, i, load(force, i) + fx)
        store(force, i + n, load(force, i + n) + fy)
        store(force, i + 2 * n, load(force, i + 2 * n) + fz)
        store(force, i + 3 * n, load(force, i + 3 * n) + tx)
        store(force, i + 4 * n, load(force, i + 4 * n) + ty)
        store(force, i + 5 * n, load(force, i + 5 * n) + tz)
        energy += total(double)
        if contact > 0.0:
            touching += total(close) / contact
    return 0.5 * energy, 0.5 * touching


@kernel
def _walls_kernel(state, gradient, walls):
    """Energy of the walls; adds its gradient."""
    n = state.size // 6
    energy = 0.0
    for i in range(n):
        x, y, z = state[i], state[n + i], state[2 * n + i]
        if near_kernel(x, y, z, walls):
            wall, along_x, along_y, along_z = wall_energy_kernel(x, y, z, walls)
            energy += wall
            gradient[i] += along_x
            gradient[n + i] += along_y
            gradient[2 * n + i] += along_z
    return energy


@kernel
def _objective_kernel(state, gradient, network, walls, delta, contact, work):
    """Bond energy, and energy of walls and contacts, of a state; fills the gradient."""
    n = state.size // 6
    room = (work.unit.size - 6 * n) // 2
    unit, force = work.unit[room:], work.force[room:]
    work.force[:] = 0
    for i in range(3 * n):
        unit[i] = state[i]
    for i in range(3 * n, 4 * n):
        a, b, c = state[i], state[i + n], state[i + 2 * n]
        length = math.sqrt(a * a + b * b + c * c)
        unit[i], unit[i + n], unit[i + 2 * n] = a / length, b / length, c / length
    energy, touching = _bonds_kernel(n, network, delta, contact, work)
    for i in range(3 * n):
        gradient[i] = -force[i]
    for i in range(3 * n, 4 * n):
        # From dE/ds of the unit vector to that of a vector of any length along it.
        a, b, c = unit[i], unit[i + n], unit[i + 2 * n]
        ga, gb, gc = force[i], force[i + n], force[i + 2 * n]
        along = ga * a + gb * b + gc * c
        length = a * state[i] + b * state[i + n] + c * state[i + 2 * n]
        gradient[i] = (ga - along * a) / length
        gradient[i + n] = (gb - along * b) / length
        gradient[i + 2 * n] = (gc - along * c) / length
    return energy, touching + _walls_kernel(state, gradient, walls)


@kernel
def _tension_kernel(state, first, second, stiffness, rest, delta, hooke, tension):
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
        squares = along_first * along_first + along_second * along_second
        natural = natural_length(rest[bond], delta, squares)
        value = stiffness[bond] * (length - natural if hooke else natural)
        tension[i] += value
        tension[j] += value


def objective(
    state: NDArray[Any], network: Network, walls: Walls, delta: float, contact: float = 0.0
) -> tuple[float, float, NDArray[Any]]:
    """Energy of the bonds, energy of the walls (kappa0 l0^2) and gradient (6 * cells,) of their sum.

    Parameters
    ----------
    state : ndarray (6 * cells,)
        x, y, z (l0) and a vector along each orientation.
    contact : float
        Stiffness (kappa0) of contacts, whose energy is counted with the walls'; 0 lets bonds invert.

    Raises
    ------
    RaptorError
        If the state does not fit the network or contains an orientation of length zero.
    """
    cells = network.cells
    if state.shape != (6 * cells,):
        raise RaptorError(f"state has shape {state.shape}; (6 * {cells},) is expected")
    if (np.linalg.norm(state[3 * cells :].reshape(3, -1), axis=0) == 0).any():
        raise RaptorError("a cell's orientation has length zero; give each a direction")
    gradient = np.empty_like(state)
    energy, wall_energy = _objective_kernel(
        state, gradient, network, walls, delta, contact, scratch(cells, state.dtype)
    )
    return float(energy), float(wall_energy), gradient


def cell_tension(
    state: NDArray[np.float64], lattice: Lattice, delta: float, kind: str = "hooke"
) -> NDArray[np.float64]:
    """Mean tension of each cell's bonds, (cells,), kappa0 l0; zero for a cell without bonds.

    `kind` is "hooke", k (|l| - L'), or "literal", k L' (paper, after equation 2).
    """
    total = np.zeros(lattice.cells)
    _tension_kernel(
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


@kernel
def _inverted_kernel(positions, sites, first, second):
    """Number of inverted bonds: those that point against their direction at casting."""
    cells = sites.shape[0]
    count = 0
    for bond in range(first.size):
        i, j = first[bond], second[bond]
        along = 0.0
        for c in range(3):
            now = positions[c * cells + j] - positions[c * cells + i]
            along += now * (sites[j, c] - sites[i, c])
        count += along < 0.0
    return count


def inverted_fraction(state: NDArray[Any], lattice: Lattice) -> float:
    """Share of inverted bonds; 0 without bonds."""
    count = _inverted_kernel(state, lattice.sites, lattice.first, lattice.second)
    return float(count) / max(1, lattice.bonds)


def inverted_share(positions: NDArray[np.float64], lattice: Lattice) -> NDArray[np.float64]:
    """Share of each cell's bonds that are inverted, (cells,).

    `positions` are (cells, 3), l0.
    """
    now = positions[lattice.second] - positions[lattice.first]
    cast = lattice.sites[lattice.second] - lattice.sites[lattice.first]
    turned = np.einsum("bc,bc->b", now, cast) < 0
    ends = np.concatenate([lattice.first[turned], lattice.second[turned]])
    return np.bincount(ends, minlength=lattice.cells) / np.maximum(coordination(lattice), 1)


def unit_orientations(state: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same state with orientations of unit length."""
    unit = state.copy()
    orientations = unit[state.size // 2 :].reshape(3, -1)
    orientations /= np.linalg.norm(orientations, axis=0)
    return unit
