"""What the simulator's kernels are measured against: the same physics, written the usual ways."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
import torch
from numpy.typing import NDArray

from raptor.condor.energy import SOFTENING, natural_length
from raptor.condor.lattice import Lattice

usual = numba.njit(nogil=True, error_model="numpy", fastmath=True)
"""As such loops are usually compiled: sums in any order."""


class Table(NamedTuple):
    """Neighbours of cell i: entries start[i] to start[i + 1] of the other arrays."""

    start: NDArray[np.int64]
    neighbour: NDArray[np.int32]
    stiffness: NDArray[np.float64]
    rest: NDArray[np.float64]


def neighbour_table(lattice: Lattice) -> Table:
    """Every bond from both its ends, by cell."""
    cell = np.concatenate([lattice.first, lattice.second])
    other = np.concatenate([lattice.second, lattice.first])
    order = np.argsort(cell, kind="stable")
    start = np.zeros(lattice.cells + 1, dtype=np.int64)
    start[1:] = np.cumsum(np.bincount(cell, minlength=lattice.cells))
    stiffness, rest = np.tile(lattice.stiffness, 2), np.tile(lattice.rest_length, 2)
    return Table(start, other[order], stiffness[order], rest[order])


@usual
def _bond(state, n, i, j, rest, delta):
    """|l| - L', |l|, u and both projections of one bond of a state with unit orientations."""
    lx, ly, lz = state[j] - state[i], state[j + n] - state[i + n], state[j + 2 * n] - state[i + 2 * n]
    length = math.sqrt(lx * lx + ly * ly + lz * lz + SOFTENING)
    ux, uy, uz = lx / length, ly / length, lz / length
    first = ux * state[i + 3 * n] + uy * state[i + 4 * n] + uz * state[i + 5 * n]
    second = ux * state[j + 3 * n] + uy * state[j + 4 * n] + uz * state[j + 5 * n]
    natural = natural_length(rest, delta, first * first + second * second)
    return length - natural, length, ux, uy, uz, first, second


@usual
def _pull(state, n, i, j, stiffness, rest, delta):
    """Energy of one bond, dE/dl (3) and dE/ds of both ends along u."""
    stretch, length, ux, uy, uz, first, second = _bond(state, n, i, j, rest, delta)
    tension = stiffness * stretch
    twist = -rest * delta * tension
    along = tension - twist * (first * first + second * second) / length
    a, b = twist * first / length, twist * second / length
    px = along * ux + a * state[i + 3 * n] + b * state[j + 3 * n]
    py = along * uy + a * state[i + 4 * n] + b * state[j + 4 * n]
    pz = along * uz + a * state[i + 5 * n] + b * state[j + 5 * n]
    return 0.5 * tension * stretch, px, py, pz, ux, uy, uz, twist * first, twist * second


@usual
def gradient_by_neighbours(state, gradient, table, delta):
    """Energy and gradient (unit orientations), each bond twice over a table of neighbours."""
    n = state.size // 6
    energy = 0.0
    for i in range(n):
        fx = fy = fz = tx = ty = tz = 0.0
        for entry in range(table.start[i], table.start[i + 1]):
            e, px, py, pz, ux, uy, uz, turn, _ = _pull(
                state, n, i, table.neighbour[entry], table.stiffness[entry], table.rest[entry], delta
            )
            energy += 0.5 * e
            fx, fy, fz = fx - px, fy - py, fz - pz
            tx, ty, tz = tx + turn * ux, ty + turn * uy, tz + turn * uz
        gradient[i], gradient[i + n], gradient[i + 2 * n] = fx, fy, fz
        gradient[i + 3 * n], gradient[i + 4 * n], gradient[i + 5 * n] = tx, ty, tz
    return energy


@usual
def gradient_by_bonds(state, gradient, first, second, stiffness, rest, delta):
    """Energy and gradient (unit orientations), each bond once, one after another."""
    n = state.size // 6
    gradient[:] = 0.0
    energy = 0.0
    for bond in range(first.size):
        i, j = first[bond], second[bond]
        e, px, py, pz, ux, uy, uz, on_first, on_second = _pull(
            state, n, i, j, stiffness[bond], rest[bond], delta
        )
        energy += e
        for row, (p, u) in enumerate(((px, ux), (py, uy), (pz, uz))):
            gradient[i + row * n] -= p
            gradient[j + row * n] += p
            gradient[i + (row + 3) * n] += on_first * u
            gradient[j + (row + 3) * n] += on_second * u
    return energy


@usual
def _cell_energy(state, n, i, table, delta):
    energy = 0.0
    for entry in range(table.start[i], table.start[i + 1]):
        stretch = _bond(state, n, i, table.neighbour[entry], table.rest[entry], delta)[0]
        energy += 0.5 * table.stiffness[entry] * stretch * stretch
    return energy


@usual
def metropolis_sweep(state, table, delta, temperature, step, turn, rng):
    """Try every cell once, the usual way; returns the number of accepted trial moves."""
    n = state.size // 6
    accepted = 0
    old = np.empty(6)
    for i in range(n):
        before = _cell_energy(state, n, i, table, delta)
        for row in range(6):
            old[row] = state[i + row * n]
        for row in range(3):
            state[i + row * n] += step * (2.0 * rng.random() - 1.0)
            state[i + (row + 3) * n] += turn * rng.standard_normal()
        length = math.sqrt(state[i + 3 * n] ** 2 + state[i + 4 * n] ** 2 + state[i + 5 * n] ** 2)
        for row in range(3, 6):
            state[i + row * n] /= length
        after = _cell_energy(state, n, i, table, delta)
        if after <= before or rng.random() < math.exp((before - after) / temperature):
            accepted += 1
        else:
            for row in range(6):
                state[i + row * n] = old[row]
    return accepted


def torch_gradient(lattice: Lattice, delta: float) -> Callable[[NDArray[Any]], tuple[float, NDArray[Any]]]:
    """Energy and gradient by torch's automatic differentiation."""
    first, second = (torch.from_numpy(ends.astype(np.int64)) for ends in (lattice.first, lattice.second))
    stiffness, rest = torch.from_numpy(lattice.stiffness), torch.from_numpy(lattice.rest_length)

    def evaluate(state: NDArray[Any]) -> tuple[float, NDArray[Any]]:
        variable = torch.from_numpy(state).reshape(6, -1).requires_grad_()
        positions, orientations = variable[:3], variable[3:] / variable[3:].norm(dim=0)
        displacement = positions[:, second] - positions[:, first]
        length = (displacement.square().sum(0) + SOFTENING).sqrt()
        u = displacement / length
        squares = sum((u * orientations[:, end]).sum(0).square() for end in (first, second))
        stretch = length - natural_length(rest, delta, squares)
        energy = (0.5 * stiffness * stretch.square()).sum()
        (gradient,) = torch.autograd.grad(energy, variable)
        return energy.item(), gradient.numpy().ravel()

    return evaluate
