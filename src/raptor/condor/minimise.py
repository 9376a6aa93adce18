"""Minimisation of positions and orientations together: limited-memory BFGS, compiled whole.

Reference: J. Nocedal and S. Wright, Numerical Optimization, algorithms 7.4 and 7.5, with the
two-loop recursion done on the dot products of the stored vectors (W. Chen, Z. Wang, J. Zhou,
Large-scale L-BFGS using MapReduce, NIPS 2014): each stored vector is read twice a step instead of
four times, and stored in single precision. Steps are bounded, so that no cell jumps through a wall
or its neighbours, and the objective (bonds and walls) never rises over accepted steps.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raptor.condor.energy import SMALLEST_LEVER, Scratch, _objective_kernel, scratch, unit_orientations
from raptor.condor.network import Network
from raptor.condor.simd import (
    DOUBLES,
    dot,
    doubles,
    larger,
    largest,
    load_double,
    magnitude,
    muladd,
    sqrt,
    total,
)
from raptor.condor.walls import Walls
from raptor.core.compiled import kernel
from raptor.core.errors import RaptorError

MEMORY = 6  # pairs of steps that the inverse Hessian is built from
MAX_STEP = 0.15  # l0: the farthest that one step moves any coordinate of a cell
MAX_TURN = 0.5  # radians, about: the farthest that one step turns it
SUFFICIENT = 1e-4  # Armijo's constant
BACKTRACKS = 12
WINDOW = 25  # evaluations over which the fall of the energy is judged
SMALL_ENERGY = 1e-2  # kappa0 l0^2 a cell, over Delta^2: falls of less energy are judged by this
BLOCK = 1024  # numbers that are worked on at a time, so that they stay in the innermost cache


class Minimum(NamedTuple):
    """A minimised state and how it was reached.

    `state` as in `energy`, `energy` of the bonds and `wall_energy` of walls and contacts (kappa0 l0^2),
    `residual_gradient` its largest component (kappa0 l0; orientations as in `orientation_lever`),
    `evaluations` of the objective, whether it converged as was asked for, and the stiffness
    of the contacts that acted (kappa0).
    """

    state: NDArray[Any]
    energy: float
    wall_energy: float
    residual_gradient: float
    evaluations: int
    converged: bool
    contact: float = 0.0


class _Work(NamedTuple):
    """Arrays that one minimisation works in.

    Of pair p of the memory: `steps[p]` s_p and `changes[p]` y_p of state and gradient; `sy[p, q]`
    s_p.y_q, `yy[p, q]` y_p.y_q, `sg[p]` s_p.g and `yg[p]` y_p.g. `held` is the number of pairs held,
    the newest pair, and the number of pairs ever written since none was held.
    """

    gradient: NDArray[Any]
    trial: NDArray[Any]
    trial_gradient: NDArray[Any]
    direction: NDArray[Any]
    steps: NDArray[np.float32]
    changes: NDArray[np.float32]
    sy: NDArray[np.float64]
    yy: NDArray[np.float64]
    sg: NDArray[np.float64]
    yg: NDArray[np.float64]
    held: NDArray[np.int64]
    scratch: Scratch


@kernel
def _dot(a, b):
    whole = a.size - a.size % DOUBLES
    lanes = doubles(0.0)
    for i in range(0, whole, DOUBLES):
        lanes = muladd(load_double(a, i), load_double(b, i), lanes)
    product = total(lanes)
    for i in range(whole, a.size):
        product += a[i] * b[i]
    return product


@kernel
def _largest(a):
    whole = a.size - a.size % DOUBLES
    lanes = doubles(0.0)
    for i in range(0, whole, DOUBLES):
        lanes = larger(lanes, magnitude(load_double(a, i)))
    value = largest(lanes)
    for i in range(whole, a.size):
        value = max(value, float(abs(a[i])))
    return value


@kernel
def _products_kernel(sp, yp, s, g):
    """s_p.g, y_p.g and y_p.s of arrays of equal size."""
    whole = g.size - g.size % DOUBLES
    zero = doubles(0.0)
    sg, yg, ys = zero, zero, zero
    for i in range(0, whole, DOUBLES):
        y, gradient = load_double(yp, i), load_double(g, i)
        sg = muladd(load_double(sp, i), gradient, sg)
        yg = muladd(y, gradient, yg)
        ys = muladd(y, load_double(s, i), ys)
    sums = total(sg), total(yg), total(ys)
    for i in range(whole, g.size):
        y = float(yp[i])
        sums = sums[0] + float(sp[i]) * g[i], sums[1] + y * g[i], sums[2] + y * s[i]
    return sums


@kernel
def _residual_gradient_kernel(state, gradient, lever):
    """Largest component of the gradient, that by orientations as for vectors of the lever's length."""
    n = state.size // 6
    whole = n - n % DOUBLES
    lanes = doubles(0.0)
    for i in range(3 * n, 3 * n + whole, DOUBLES):
        a, b, c = load_double(state, i), load_double(state, i + n), load_double(state, i + 2 * n)
        turn = larger(magnitude(load_double(gradient, i)), magnitude(load_double(gradient, i + n)))
        turn = larger(turn, magnitude(load_double(gradient, i + 2 * n)))
        lanes = larger(lanes, turn * sqrt(dot(a, a, b, b, c, c)))
    torque = largest(lanes)
    for i in range(3 * n + whole, 4 * n):
        a, b, c = float(state[i]), float(state[i + n]), float(state[i + 2 * n])
        turn = max(abs(gradient[i]), abs(gradient[i + n]), abs(gradient[i + 2 * n]))
        torque = max(torque, turn * math.sqrt(a * a + b * b + c * c))
    return max(_largest(gradient[: 3 * n]), torque / lever)


@kernel
def _remember_kernel(state, work, slot, written):
    """Go to the trial state, and store the step that led there as pair `slot` of those `written`.

    Products of a pair with the change of the gradient are changes of its products with the gradient.
    """
    for p in range(written):
        work.sy[p, slot], work.yy[p, slot] = -work.sg[p], -work.yg[p]
        work.sy[slot, p] = work.sg[p] = work.yg[p] = 0.0
    curvature = square = 0.0
    for start in range(0, state.size, BLOCK):
        end = min(start + BLOCK, state.size)
        s, y = work.steps[slot, start:end], work.changes[slot, start:end]
        x, g = state[start:end], work.gradient[start:end]
        new_x, new_g = work.trial[start:end], work.trial_gradient[start:end]
        for i in range(end - start):
            s[i] = new_x[i] - x[i]
            y[i] = new_g[i] - g[i]
            x[i] = new_x[i]
            g[i] = new_g[i]
        curvature += _dot(s, y)
        square += _dot(y, y)
        for p in range(written):
            sg, yg, ys = _products_kernel(work.steps[p, start:end], work.changes[p, start:end], s, g)
            work.sg[p] += sg
            work.yg[p] += yg
            work.sy[slot, p] += ys
    for p in range(written):
        work.sy[p, slot] += work.sg[p]
        work.yy[p, slot] += work.yg[p]
        work.yy[slot, p] = work.yy[p, slot]
    work.sy[slot, slot], work.yy[slot, slot] = curvature, square


@kernel
def _keep_kernel(state, work):
    """Go to the trial state; hold the step that led there, unless it shows no curvature."""
    memory = work.sg.size
    stored, newest, written = work.held
    if stored == 0:
        newest, written = -1, 0
    slot = (newest + 1) % memory
    written = max(written, slot + 1)
    _remember_kernel(state, work, slot, written)
    if work.sy[slot, slot] > 1e-10 * work.yy[slot, slot]:
        newest = slot
        stored = min(stored + 1, memory)
    else:
        stored = min(stored, memory - 1)  # the pair that stood in this slot is gone
    work.held[0], work.held[1], work.held[2] = stored, newest, written


@kernel
def _direction_kernel(work):
    """Two-loop recursion: direction = - (inverse Hessian) gradient; returns its slope.

    And its largest component by positions, and by orientations.
    """
    memory = work.sg.size
    stored, newest = work.held[0], work.held[1]
    on_s, on_y = np.zeros(memory), np.zeros(memory)
    alpha = np.zeros(memory)
    scale = 1.0
    for back in range(stored):
        p = (newest - back) % memory
        along = work.sg[p]
        for q in range(memory):
            along -= alpha[q] * work.sy[p, q]
        alpha[p] = along / work.sy[p, p]
    if stored > 0:
        scale = work.sy[newest, newest] / work.yy[newest, newest]
    for p in range(memory):
        on_y[p] = -scale * alpha[p]
    for back in range(stored - 1, -1, -1):
        p = (newest - back) % memory
        along = scale * work.yg[p]
        for q in range(memory):
            along += on_y[q] * work.yy[q, p] + on_s[q] * work.sy[q, p]
        on_s[p] = alpha[p] - along / work.sy[p, p]
    # In the precision of the state, so that nothing is converted number by number.
    by_s, by_y = on_s.astype(work.direction.dtype), on_y.astype(work.direction.dtype)
    by_g = np.full(1, scale).astype(work.direction.dtype)[0]
    slope = move = turn = 0.0
    half, start = work.direction.size // 2, 0
    while start < 2 * half:
        end = min(start + BLOCK, half if start < half else 2 * half)
        d, g = work.direction[start:end], work.gradient[start:end]
        for i in range(end - start):
            d[i] = -by_g * g[i]
        for back in range(stored):
            p = (newest - back) % memory
            s, y = work.steps[p, start:end], work.changes[p, start:end]
            a, b = by_s[p], by_y[p]
            for i in range(end - start):
                d[i] -= a * s[i] + b * y[i]
        slope += _dot(d, g)
        if start < half:
            move = max(move, _largest(d))
        else:
            turn = max(turn, _largest(d))
        start = end
    return slope, move, turn


@kernel
def _search_kernel(state, before, slope, length, network, walls, delta, contact, work):
    """Shorten a step until the objective falls enough; returns the step and the new energies."""
    used = 0
    energy = wall_energy = 0.0
    for _ in range(BACKTRACKS):
        for i in range(state.size):
            work.trial[i] = state[i] + length * work.direction[i]
        energy, wall_energy = _objective_kernel(
            work.trial,
            work.trial_gradient,
            network,
            walls,
            delta,
            contact,
            work.scratch,
        )
        used += 1
        value = energy + wall_energy
        if value <= before + SUFFICIENT * length * slope:
            return length, energy, wall_energy, used
        # The minimum of the parabola through what is known, within bounds.
        best = -0.5 * slope * length * length / (value - before - slope * length)
        length = max(0.1 * length, min(0.5 * length, best))
    return 0.0, energy, wall_energy, used


@kernel
def _minimise_kernel(
    state, network, walls, delta, contact, lever, tolerance, ftol, thorough, max_evaluations, work
):
    """Minimise in place; returns energies, largest gradient, evaluations and whether it settled."""
    energy, wall_energy = _objective_kernel(
        state, work.gradient, network, walls, delta, contact, work.scratch
    )
    used = 1
    work.held[0] = 0
    looked, energy_then, calm = used, energy + wall_energy, False
    while used < max_evaluations:
        if used - looked >= WINDOW:
            scale = max(energy + wall_energy, SMALL_ENERGY * lever * lever * (state.size // 6))
            calm = energy_then - energy - wall_energy <= ftol * scale
            looked, energy_then = used, energy + wall_energy
        small = _residual_gradient_kernel(state, work.gradient, lever) <= tolerance
        if (small and calm) if thorough else (small or calm):
            break
        slope, move, turn = _direction_kernel(work)
        if slope >= 0.0:
            work.held[0] = 0
            slope, move, turn = _direction_kernel(work)
        # No move or turn goes beyond its bound, and the first of all not far.
        longest = min(MAX_STEP / max(move, 1e-30), MAX_TURN * lever / max(turn, 1e-30))
        length = min(1.0, longest if work.held[0] > 0 else 0.1 * longest)
        length, new_energy, new_wall_energy, trials = _search_kernel(
            state, energy + wall_energy, slope, length, network, walls, delta, contact, work
        )
        used += trials
        if length == 0.0:
            if work.held[0] == 0:
                calm = True
                break  # as low as rounding allows
            work.held[0] = 0
            continue
        _keep_kernel(state, work)
        energy, wall_energy = new_energy, new_wall_energy
    return energy, wall_energy, _residual_gradient_kernel(state, work.gradient, lever), used, calm


def _workplace(state: NDArray[Any]) -> _Work:
    """Arrays to minimise a state in."""
    return _Work(
        gradient=np.zeros_like(state),
        trial=np.empty_like(state),
        trial_gradient=np.empty_like(state),
        direction=np.empty_like(state),
        steps=np.zeros((MEMORY, state.size), np.float32),
        changes=np.zeros((MEMORY, state.size), np.float32),
        sy=np.zeros((MEMORY, MEMORY)),
        yy=np.zeros((MEMORY, MEMORY)),
        sg=np.zeros(MEMORY),
        yg=np.zeros(MEMORY),
        held=np.zeros(3, np.int64),
        scratch=scratch(state.size // 6, state.dtype),
    )


def orientation_lever(delta: float) -> float:
    """Length of the vectors that stand for orientations while a state is minimised, l0.

    Displacements grow as Delta and energy as Delta^2, so the energy of turning a cell is Delta^2
    times as stiff as that of moving it. With vectors of length Delta both are equally stiff, and
    forces and torques (per length) both grow as Delta: the scale of the tolerance.
    """
    return max(delta, SMALLEST_LEVER)


def minimise(
    state: NDArray[Any],
    network: Network,
    walls: Walls,
    delta: float,
    *,
    tolerance: float,
    ftol: float = -1.0,
    thorough: bool = False,
    contact: float = 0.0,
    max_evaluations: int,
) -> Minimum:
    """Minimise the energy of bonds and walls from a state (6 * cells,).

    Parameters
    ----------
    tolerance : float
        Largest component of the gradient at which the state has converged, in units of
        kappa0 l0 times `orientation_lever(delta)`.
    ftol : float
        The state is left, though not converged, when `WINDOW` evaluations lower the energy by no
        more than this part, or, where there is next to none, by this part of `SMALL_ENERGY`.
    thorough : bool
        Leave it only when both are met, or no step lowers the energy any more.
    contact : float
        Stiffness of contacts (kappa0), as in `objective`.
    max_evaluations : int
        Evaluations of the objective, after which no further step is taken.

    Raises
    ------
    RaptorError
        If the state does not fit the network or is not finite.
    """
    if state.size != 6 * network.cells or not np.isfinite(state).all():
        raise RaptorError("the state to minimise does not fit the network, or is not finite")
    state = unit_orientations(state)
    lever = orientation_lever(delta)
    state[state.size // 2 :] *= lever
    work = _workplace(state)
    energy, wall_energy, residual, used, settled = _minimise_kernel(
        state, network, walls, delta, contact, lever, tolerance * lever, ftol, thorough, max_evaluations, work
    )
    finite = math.isfinite(energy + wall_energy) and bool(np.isfinite(state).all())
    converged = finite and residual <= tolerance * lever and (settled or not thorough)
    return Minimum(unit_orientations(state), energy, wall_energy, residual, used, converged, contact)
