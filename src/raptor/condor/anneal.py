"""The paper's solver: simulated annealing with single-cell trial moves (section "CONDOR model").

One trial move gives one cell a new position and a new orientation and is accepted by Metropolis'
condition. A sweep tries every cell once, a chunk of a sublattice at a time: cells of a chunk share no
bond, so trying them together is equivalent to trying them one after another. Each trial obeys detailed
balance, and the fixed order preserves the equilibrium distribution. Proposal sizes adapt to the
acceptance rate between sweeps (the paper states no sizes), which violates balance slightly while they
change. The energy of a rotation scales as Delta^2, so rotations are larger than moves by a factor that
scales as 1 / Delta.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from raptor.condor.energy import SMALLEST_LEVER, SOFTENING, natural_length, unit_orientations
from raptor.condor.network import Network
from raptor.condor.simd import dot, lanes, load, muladd, positive, sqrt, store, where
from raptor.condor.walls import Walls, wall_energy_kernel
from raptor.core.compiled import kernel
from raptor.core.errors import RaptorError

INITIAL_TEMPERATURE = 0.0625  # kappa0 l0^2 (paper)
TEMPERATURE_FACTOR = 1e7  # initial over final temperature (paper)
TARGET_ACCEPTANCE = 0.4
LARGEST_STEP = 0.3  # l0, of each coordinate; a proposal cannot cross a tether
LARGEST_TURN = 2.0  # radians, about
STIFFNESS_OF_A_CELL = 10.0  # kappa0; sets the initial proposal size
TURN_OVER_MOVE = 3.0  # size of rotations, times Delta, over that of moves
DRAWS = 7  # random numbers per trial move
ROWS = 7  # of a chunk's trial: six for the state and one for the energy change


class Annealed(NamedTuple):
    """An annealed state (6 * cells,) and the acceptance rate over its last tenth of sweeps."""

    state: NDArray[Any]
    acceptance_rate: float


class _Work(NamedTuple):
    """Work arrays of a sweep: random numbers, and the energy and state of a chunk's trials."""

    random: NDArray[Any]
    trial: NDArray[Any]


@kernel
def _uniform_kernel(random, key, count):
    """Fill an array with random numbers from 0 to 1: number `count` onwards of stream `key`.

    SplitMix64 (G. Steele, D. Lea, C. Flood, OOPSLA 2014, doi:10.1145/2660193.2660195), which computes any
    number of a stream without its predecessors, and so all lanes at once.
    """
    for i in range(random.size):
        z = key + (count + np.uint64(i)) * np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        random[i] = ((z ^ (z >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53


@kernel
def _circle_kernel(part):
    """Cosine and sine of 2 pi part, for lanes of parts in [-1/2, 1/2].

    From the sine of half the angle, a polynomial: lanes have no sine of their own. Exactly on the
    unit circle; the angle is off by at most 1e-4, and but for the ends of the range by 1e-8.
    """
    p = part * part
    half = -0.00702837 * p + 0.08205039
    half = part * (((half * p - 0.5992522) * p + 2.55016332) * p - 5.16771276) * p + math.pi * part
    return 1.0 - 2.0 * half * half, 2.0 * half * sqrt(positive(1.0 - half * half))


@kernel
def _propose_kernel(old, random, step, turn):
    """New positions, uniform in a cube, and orientations, rotated isotropically."""
    x, y, z, a, b, c = old
    width = random.size // DRAWS
    x = x + step * (2.0 * load(random, 0) - 1.0)
    y = y + step * (2.0 * load(random, width) - 1.0)
    z = z + step * (2.0 * load(random, 2 * width) - 1.0)
    upright = 2.0 * load(random, 3 * width) - 1.0
    cosine, sine = _circle_kernel(load(random, 4 * width) - 0.5)
    length = turn * load(random, 5 * width)
    flat = length * sqrt(1.0 - upright * upright)
    a, b, c = a + flat * cosine, b + flat * sine, c + length * upright
    inverse = 1.0 / sqrt(dot(a, a, b, b, c, c))
    return x, y, z, a * inverse, b * inverse, c * inverse


@kernel
def _stretch_kernel(lx, ly, lz, a, b, c, ua, ub, uc, rest, delta):
    """|l| - L' of bonds, given displacements and the orientations of both ends."""
    squared = dot(lx, lx, ly, ly, lz, lz) + SOFTENING
    inverse = 1.0 / sqrt(squared)
    first = dot(lx, a, ly, b, lz, c) * inverse
    second = dot(lx, ua, ly, ub, lz, uc) * inverse
    squares = muladd(first, first, second * second)
    return squared * inverse - natural_length(rest, delta, squares)


@kernel
def _difference_kernel(state, n, room, network, chunk, old, new, delta):
    """Energy change of each trial move of a chunk, over the bonds of its cell."""
    x, y, z, a, b, c = old
    nx, ny, nz, na, nb, nc = new
    difference = x * 0.0
    for entry in range(network.entries[chunk], network.entries[chunk + 1]):
        j = network.second[entry] + room
        px, py, pz = load(state, j), load(state, j + n), load(state, j + 2 * n)
        ua, ub, uc = load(state, j + 3 * n), load(state, j + 4 * n), load(state, j + 5 * n)
        kind = network.kind[entry]
        stiffness = where(network.bits[entry], network.stiffness[kind], x)
        rest = network.rest_length[kind]
        before = _stretch_kernel(px - x, py - y, pz - z, a, b, c, ua, ub, uc, rest, delta)
        after = _stretch_kernel(px - nx, py - ny, pz - nz, na, nb, nc, ua, ub, uc, rest, delta)
        difference = muladd(stiffness * (after - before), after + before, difference)
    return 0.5 * difference


@kernel
def _accept_kernel(state, n, first, filled, walls, temperature, work):
    """Metropolis' condition for each trial move of a chunk; returns the number accepted."""
    accepted = 0
    trial, drawn = work.trial, (DRAWS - 1) * (work.random.size // DRAWS)
    for lane in range(filled):
        i = first + lane
        added = float(trial[6, lane])
        added += wall_energy_kernel(trial[0, lane], trial[1, lane], trial[2, lane], walls)[0]
        added -= wall_energy_kernel(state[i], state[i + n], state[i + 2 * n], walls)[0]
        if added <= 0.0 or work.random[drawn + lane] < math.exp(-added / temperature):
            accepted += 1
            for row in range(6):
                state[i + row * n] = trial[row, lane]
    return accepted


@kernel
def _sweep_kernel(state, n, network, walls, delta, temperature, step, turn, key, count, work):
    """Try every cell once; returns the number of accepted trial moves."""
    room = (state.size - 6 * n) // 2
    accepted = 0
    for chunk in range(network.first.size):
        i = network.first[chunk] + room
        _uniform_kernel(work.random, key, count + np.uint64(chunk * work.random.size))
        old = (
            load(state, i),
            load(state, i + n),
            load(state, i + 2 * n),
            load(state, i + 3 * n),
            load(state, i + 4 * n),
            load(state, i + 5 * n),
        )
        new = _propose_kernel(old, work.random, step, turn)
        difference = _difference_kernel(state, n, room, network, chunk, old, new, delta)
        for row, value in enumerate((*new, difference)):
            store(work.trial[row], 0, value)
        accepted += _accept_kernel(state, n, i, network.filled[chunk], walls, temperature, work)
    return accepted


@kernel
def _anneal_kernel(state, n, network, walls, delta, initial, factor, sweeps, key, work):
    """Cool geometrically over the sweeps; returns the acceptance rate of the last tenth."""
    size = min(LARGEST_STEP, math.sqrt(initial / STIFFNESS_OF_A_CELL))
    lever = max(delta, SMALLEST_LEVER)
    accepted_late = 0
    late = max(1, sweeps // 10)
    draws = np.uint64(network.first.size * work.random.size)
    for sweep in range(sweeps):
        turn = min(LARGEST_TURN, TURN_OVER_MOVE * size / lever)
        temperature = initial * factor ** (-sweep / max(1, sweeps - 1))
        accepted = _sweep_kernel(
            state, n, network, walls, delta, temperature, size, turn, key,
            np.uint64(sweep) * draws, work,
        )  # fmt: skip
        size *= math.exp(0.2 * (accepted / n - TARGET_ACCEPTANCE))
        size = min(LARGEST_STEP, size)
        if sweep >= sweeps - late:
            accepted_late += accepted
    return accepted_late / (late * n)


def anneal(
    state: NDArray[Any],
    order: NDArray[np.int64],
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
    order, network
        As `build_sublattices` returns them.
    sweeps : int
        Trial moves per cell (1e6 in the paper).
    initial_temperature : float
        kappa0 l0^2.
    temperature_factor : float
        Initial over final temperature.

    Raises
    ------
    RaptorError
        If the schedule is invalid.
    """
    if sweeps < 1 or initial_temperature <= 0 or temperature_factor < 1:
        raise RaptorError(
            f"anneal with {sweeps} sweeps from temperature {initial_temperature} by a factor of "
            f"{temperature_factor}: at least 1 sweep, a positive temperature and a factor of at "
            "least 1 are needed"
        )
    width = lanes(state.dtype)
    ordered = np.zeros(state.size + 2 * width, state.dtype)
    ordered[width:-width] = unit_orientations(state).reshape(6, -1)[:, order].ravel()
    work = _Work(np.zeros(DRAWS * width, state.dtype), np.zeros((ROWS, width), state.dtype))
    key = rng.integers(2**64, dtype=np.uint64)
    acceptance_rate = _anneal_kernel(
        ordered, len(order), network, walls, delta, initial_temperature, temperature_factor, sweeps, key, work
    )
    annealed = np.empty_like(state)
    annealed.reshape(6, -1)[:, order] = ordered[width:-width].reshape(6, -1)
    return Annealed(annealed, acceptance_rate)
