"""The paper's solver: simulated annealing with single-cell trial moves (section "CONDOR model").

One trial move gives one cell a new position and a new orientation and is accepted by Metropolis'
condition. A sweep tries every cell once, in lattice order; each trial alone obeys detailed
balance, the fixed order keeps the equilibrium distribution. Adapting the size of proposals to the
acceptance rate between sweeps (the paper states no sizes) breaks it slightly while sizes change.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from raptor.compiled import kernel
from raptor.condor.energy import SOFTENING, natural_length_kernel, unit_orientations
from raptor.condor.network import Network
from raptor.condor.walls import Walls, wall_energy
from raptor.errors import RaptorError

INITIAL_TEMPERATURE = 0.0625  # kappa0 l0^2 (paper)
TEMPERATURE_FACTOR = 1e7  # initial over final temperature (paper)
TARGET_ACCEPTANCE = 0.4
LARGEST_STEP = 0.3  # l0; a proposal cannot cross a tether
LARGEST_TURN = 1.0  # radians, about


class Annealed(NamedTuple):
    """An annealed state (6 * cells,) and the acceptance rate over its last tenth of sweeps."""

    state: NDArray[np.float64]
    acceptance: float


@kernel
def _cell_energy_kernel(i, x, y, z, sx, sy, sz, state, network, walls, delta):
    """Energy of one cell's bonds and walls, were it at (x, y, z) with orientation (sx, sy, sz)."""
    cells = state.size // 6
    energy = wall_energy(x, y, z, walls)[0]
    for entry in range(network.start[i], network.start[i + 1]):
        j = network.neighbour[entry]
        lx, ly, lz = state[j] - x, state[cells + j] - y, state[2 * cells + j] - z
        length = math.sqrt(lx * lx + ly * ly + lz * lz + SOFTENING)
        along_first = (lx * sx + ly * sy + lz * sz) / length
        along_second = (
            lx * state[3 * cells + j] + ly * state[4 * cells + j] + lz * state[5 * cells + j]
        ) / length
        natural = natural_length_kernel(network.neighbour_rest[entry], delta, along_first, along_second)
        energy += 0.5 * network.neighbour_stiffness[entry] * (length - natural) ** 2
    return energy


@kernel
def _sweep_kernel(state, network, walls, delta, temperature, step, turn, rng):
    """Try every cell once; returns the number of accepted trial moves."""
    cells = state.size // 6
    accepted = 0
    for i in range(cells):
        x, y, z = state[i], state[cells + i], state[2 * cells + i]
        sx, sy, sz = state[3 * cells + i], state[4 * cells + i], state[5 * cells + i]
        before = _cell_energy_kernel(i, x, y, z, sx, sy, sz, state, network, walls, delta)
        x += step * (2.0 * rng.random() - 1.0)
        y += step * (2.0 * rng.random() - 1.0)
        z += step * (2.0 * rng.random() - 1.0)
        sx += turn * rng.standard_normal()
        sy += turn * rng.standard_normal()
        sz += turn * rng.standard_normal()
        inverse = 1.0 / math.sqrt(sx * sx + sy * sy + sz * sz)
        sx, sy, sz = sx * inverse, sy * inverse, sz * inverse
        after = _cell_energy_kernel(i, x, y, z, sx, sy, sz, state, network, walls, delta)
        if after <= before or rng.random() < math.exp((before - after) / temperature):
            accepted += 1
            state[i], state[cells + i], state[2 * cells + i] = x, y, z
            state[3 * cells + i], state[4 * cells + i], state[5 * cells + i] = sx, sy, sz
    return accepted


@kernel
def _anneal_kernel(state, network, walls, delta, initial, factor, sweeps, rng):
    """Cool geometrically over the sweeps; returns the acceptance rate of the last tenth."""
    cells = state.size // 6
    size = 1.0
    accepted_late = 0
    late = max(1, sweeps // 10)
    for sweep in range(sweeps):
        temperature = initial * factor ** (-sweep / max(1, sweeps - 1))
        accepted = _sweep_kernel(
            state, network, walls, delta, temperature, LARGEST_STEP * size, LARGEST_TURN * size, rng
        )
        size *= math.exp(0.2 * (accepted / cells - TARGET_ACCEPTANCE))
        size = min(1.0, size)
        if sweep >= sweeps - late:
            accepted_late += accepted
    return accepted_late / (late * cells)


def anneal(
    state: NDArray[np.float64],
    network: Network,
    walls: Walls,
    delta: float,
    rng: Generator,
    *,
    sweeps: int,
    initial_temperature: float = INITIAL_TEMPERATURE,
    temperature_factor: float = TEMPERATURE_FACTOR,
) -> Annealed:
    """Anneal a state (6 * cells,) by the paper's schedule.

    Parameters
    ----------
    sweeps : int
        Trial moves a cell (1e6 in the paper).
    initial_temperature : float
        kappa0 l0^2.
    temperature_factor : float
        Initial over final temperature.

    Raises
    ------
    RaptorError
        Where the schedule makes no sense.
    """
    if sweeps < 1 or initial_temperature <= 0 or temperature_factor < 1:
        raise RaptorError(
            f"anneal with {sweeps} sweeps from temperature {initial_temperature} by a factor of "
            f"{temperature_factor}: at least 1 sweep, a positive temperature and a factor of at "
            "least 1 are needed"
        )
    state = unit_orientations(state)
    acceptance = _anneal_kernel(
        state, network, walls, delta, initial_temperature, temperature_factor, sweeps, rng
    )
    return Annealed(state, acceptance)
