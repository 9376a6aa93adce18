"""Minimisation of positions and orientations together: limited-memory BFGS, compiled whole.

Reference: J. Nocedal and S. Wright, Numerical Optimization, algorithms 7.4 and 7.5. Steps are
bounded, so that no cell jumps through a wall or its neighbours, and the objective (bonds and
walls) never rises over accepted steps.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raptor.compiled import kernel
from raptor.condor.energy import _objective_kernel, scratch, unit_orientations
from raptor.condor.network import Network
from raptor.condor.walls import Walls
from raptor.errors import RaptorError

MEMORY = 8  # pairs of steps that the inverse Hessian is built from
MAX_STEP = 0.15  # l0: the farthest that one step moves any coordinate of a cell
MAX_TURN = 0.5  # radians, about: the farthest that one step turns it
SMALLEST_LEVER = 0.02  # l0; for Delta near 0, where nothing moves
SUFFICIENT = 1e-4  # Armijo's constant
BACKTRACKS = 12


class Minimum(NamedTuple):
    """A minimised state and how it was reached.

    `state` as in `energy`, `energy` of the bonds and `walled` of the walls (kappa0 l0^2),
    `gradient` its largest component (kappa0 l0; orientations as in `orientation_lever`),
    `evaluations` of the objective, and whether the gradient fell below the tolerance.
    """

    state: NDArray[np.float64]
    energy: float
    walled: float
    gradient: float
    evaluations: int
    converged: bool


class _Work(NamedTuple):
    """Arrays that one minimisation works in."""

    gradient: NDArray[np.float64]
    trial: NDArray[np.float64]
    trial_gradient: NDArray[np.float64]
    direction: NDArray[np.float64]
    steps: NDArray[np.float64]
    changes: NDArray[np.float64]
    curvature: NDArray[np.float64]
    unit: NDArray[np.float64]
    force: NDArray[np.float64]
    buffer: NDArray[np.float64]


@kernel
def _dot(a, b):
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@kernel
def _largest(a):
    value = 0.0
    for i in range(a.size):
        value = max(value, abs(a[i]))
    return value


@kernel
def _longest_step(direction, lever):
    """The longest multiple of a direction that keeps every move and turn within bounds."""
    half = direction.size // 2
    move = _largest(direction[:half])
    turn = _largest(direction[half:]) / lever
    return min(MAX_STEP / max(move, 1e-300), MAX_TURN / max(turn, 1e-300))


@kernel
def _direction_kernel(work, stored, newest):
    """Two-loop recursion: direction = - (inverse Hessian) gradient."""
    d = work.direction
    d[:] = work.gradient
    alpha = np.zeros(work.curvature.size)
    memory = work.curvature.size
    for back in range(stored):
        p = (newest - back) % memory
        alpha[p] = _dot(work.steps[p], d) / work.curvature[p]
        a, change = alpha[p], work.changes[p]
        for i in range(d.size):
            d[i] -= a * change[i]
    if stored > 0:
        change = work.changes[newest]
        scale = work.curvature[newest] / _dot(change, change)
        for i in range(d.size):
            d[i] *= scale
    for back in range(stored - 1, -1, -1):
        p = (newest - back) % memory
        a = alpha[p] - _dot(work.changes[p], d) / work.curvature[p]
        step = work.steps[p]
        for i in range(d.size):
            d[i] += a * step[i]
    for i in range(d.size):
        d[i] = -d[i]


@kernel
def _search_kernel(state, total, slope, length, network, walls, delta, work):
    """Shorten a step until the objective falls enough; returns the step and the new energies."""
    used = 0
    energy = walled = 0.0
    for _ in range(BACKTRACKS):
        for i in range(state.size):
            work.trial[i] = state[i] + length * work.direction[i]
        energy, walled = _objective_kernel(
            work.trial,
            work.trial_gradient,
            network,
            walls,
            delta,
            work.unit,
            work.force,
            work.buffer,
        )
        used += 1
        value = energy + walled
        if value <= total + SUFFICIENT * length * slope:
            return length, energy, walled, used
        # The minimum of the parabola through what is known, within bounds.
        best = -0.5 * slope * length * length / (value - total - slope * length)
        length = max(0.1 * length, min(0.5 * length, best))
    return 0.0, energy, walled, used


@kernel
def _minimise_kernel(state, network, walls, delta, lever, tolerance, limit, work):
    """Minimise in place; returns bond energy, wall energy, largest gradient, evaluations."""
    energy, walled = _objective_kernel(
        state, work.gradient, network, walls, delta, work.unit, work.force, work.buffer
    )
    used = 1
    stored = 0
    newest = -1
    memory = work.curvature.size
    while used < limit and _largest(work.gradient) > tolerance:
        _direction_kernel(work, stored, newest)
        slope = _dot(work.direction, work.gradient)
        if slope >= 0.0:
            stored = 0
            _direction_kernel(work, stored, newest)
            slope = _dot(work.direction, work.gradient)
        length = min(1.0, _longest_step(work.direction, lever))
        if stored == 0:
            length = min(length, 0.1 * _longest_step(work.direction, lever))
        length, new_energy, new_walled, trials = _search_kernel(
            state, energy + walled, slope, length, network, walls, delta, work
        )
        used += trials
        if length == 0.0:
            if stored == 0:
                break  # as low as rounding allows
            stored = 0
            continue
        slot = (newest + 1) % memory
        curvature = 0.0
        for i in range(state.size):
            step = work.trial[i] - state[i]
            change = work.trial_gradient[i] - work.gradient[i]
            work.steps[slot, i] = step
            work.changes[slot, i] = change
            curvature += step * change
            state[i] = work.trial[i]
            work.gradient[i] = work.trial_gradient[i]
        energy, walled = new_energy, new_walled
        if curvature > 1e-10 * _dot(work.changes[slot], work.changes[slot]):
            work.curvature[slot] = curvature
            newest = slot
            stored = min(stored + 1, memory)
        else:
            stored = min(stored, memory - 1)  # the pair that stood in this slot is gone
    return energy, walled, _largest(work.gradient), used


def orientation_lever(delta: float) -> float:
    """Length of the vectors that stand for orientations while a state is minimised, l0.

    Displacements grow as Delta and energy as Delta^2, so the energy of turning a cell is Delta^2
    times as stiff as that of moving it. With vectors of length Delta both are equally stiff, and
    forces and torques (per length) both grow as Delta: the scale of the tolerance.
    """
    return max(delta, SMALLEST_LEVER)


def minimise(
    state: NDArray[np.float64],
    network: Network,
    walls: Walls,
    delta: float,
    *,
    tolerance: float,
    limit: int,
) -> Minimum:
    """Minimise the energy of bonds and walls from a state (6 * cells,).

    Parameters
    ----------
    tolerance : float
        Largest component of the gradient at which the state has converged, in units of
        kappa0 l0 times `orientation_lever(delta)`.
    limit : int
        Evaluations of the objective at most.

    Raises
    ------
    RaptorError
        Where the state does not fit the network or is not finite.
    """
    if state.size != 6 * (len(network.start) - 1) or not np.isfinite(state).all():
        raise RaptorError("the state to minimise does not fit the network, or is not finite")
    state = unit_orientations(state)
    lever = orientation_lever(delta)
    state[state.size // 2 :] *= lever
    unit, force, buffer = scratch(state.size // 6)
    work = _Work(
        gradient=np.empty_like(state),
        trial=np.empty_like(state),
        trial_gradient=np.empty_like(state),
        direction=np.empty_like(state),
        steps=np.zeros((MEMORY, state.size)),
        changes=np.zeros((MEMORY, state.size)),
        curvature=np.zeros(MEMORY),
        unit=unit,
        force=force,
        buffer=buffer,
    )
    energy, walled, gradient, used = _minimise_kernel(
        state, network, walls, delta, lever, tolerance * lever, limit, work
    )
    finite = math.isfinite(energy + walled) and bool(np.isfinite(state).all())
    return Minimum(
        unit_orientations(state), energy, walled, gradient, used, finite and gradient <= tolerance * lever
    )
