"""Quasi-static contraction, and its one-step draft.

`contract` follows the gel from the cast lattice: Delta rises to its value in steps. At each step a few
Metropolis sweeps agitate the cells, so that they leave the shallowest minima, and then positions and
orientations are minimised together. A bond across two cells rests at L (1 - Delta); each step shortens it
by the same fraction, so steps in Delta are large while the gel is loose and small where it is dense and
folds easily. If a step inverts a bond, minimisation continues with contacts, which push it back; if that
fails, the step is repeated with contacts and without agitation. Starting hot, or at the full Delta, can
fold the network through itself; following the contraction does not.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from raptor.condor.anneal import anneal
from raptor.condor.energy import inverted_fraction
from raptor.condor.minimise import Minimum, minimise
from raptor.condor.system import System

TURNING = 0.2  # temperature of agitation, kappa0 l0^2, over Delta^2, at which orientations fluctuate
FOLDING = 0.3  # and its bound, over (1 - Delta)^2, which keeps bonds away from length zero
HOP_WARMTH = 2.0  # temperature of a hop over that of agitation
COOLING = 10.0  # first over last temperature of an agitation
FEWEST_STEPS = 3  # so that orientations are agitated more than once
CONTACT = 100.0  # kappa0, like the walls


@dataclass(frozen=True)
class Contraction:
    """How closely the contraction is followed.

    Parameters
    ----------
    shortening : float
        Largest fraction by which one step shortens a bond's natural length; 1 takes the whole
        contraction in one step.
    sweeps : int
        Metropolis sweeps of each step before minimisation.
    ftol : float
        A step but the last ends when 25 more evaluations lower the energy by no more than this part.
    last_ftol, tolerance : float
        The last ends when they lower it by no more than `last_ftol`, and the largest component of the
        gradient is within the tolerance, in kappa0 l0 times Delta. `last_ftol` less than zero: the
        tolerance alone counts.
    step_evaluations, max_evaluations : int
        Evaluations of a minimisation at most: of each before the last, since a later one puts right what it
        leaves, and of the last.
    """

    shortening: float
    sweeps: int
    ftol: float
    last_ftol: float
    tolerance: float
    step_evaluations: int
    max_evaluations: int


def agitation_temperature(delta: float) -> float:
    """Temperature at which orientations fluctuate and few bonds fold, kappa0 l0^2.

    Energies of rotation scale as Delta^2; a bond of natural length l0 (1 - Delta) inverts when thermal
    motion covers that length.
    """
    return min(TURNING * delta**2, FOLDING * (1 - delta) ** 2)


def steps_to(delta: float, shortening: float) -> NDArray[np.float64]:
    """Values of Delta, (steps,), up to delta, each shortening 1 - Delta by the same fraction.

    The fraction is at most `shortening`, and there are at least `FEWEST_STEPS` steps.
    """
    if shortening >= 1 or delta == 0:
        return np.array([delta])
    count = math.ceil(math.log(1 - delta) / math.log(1 - shortening) - 1e-9)
    count = max(count, FEWEST_STEPS)
    # One number at a time: NumPy's powers of an array differ in the last bit from processor to processor.
    return np.array([*(1 - (1 - delta) ** (step / count) for step in range(1, count)), delta])


def contract(
    state: NDArray[Any], system: System, delta: float, contraction: Contraction, rng: Generator
) -> Minimum:
    """Contract a cast state (6 * cells,) to its Delta; evaluations are summed over all steps."""
    used, contact = 0, 0.0
    for target in steps_to(delta, contraction.shortening):
        minimum = _step(state, system, target, contraction, rng, contact, last=target == delta)
        used += minimum.evaluations
        state, contact = minimum.state, minimum.contact
    return minimum._replace(evaluations=used)


def _step(
    state: NDArray[Any],
    system: System,
    delta: float,
    contraction: Contraction,
    rng: Generator,
    contact: float,
    last: bool,
) -> Minimum:
    """One step to `delta`: agitated, minimised and, but for the one-step draft, freed of inverted bonds.

    Once a step has needed contacts, all that follow have them from the outset.
    """
    trial = state
    if contraction.sweeps:
        trial = agitate(state, system, delta, contraction.sweeps, rng)
    minimum = _minimise(trial, system, delta, contraction, last, contact)
    if contraction.shortening < 1:
        minimum = _without_inversion(minimum, state, system, delta, contraction, last)
    return minimum


def _without_inversion(
    minimum: Minimum,
    start: NDArray[Any],
    system: System,
    delta: float,
    contraction: Contraction,
    last: bool,
) -> Minimum:
    """A minimum without inverted bonds: with contacts from there, or else from the start."""
    used = minimum.evaluations
    for state in (minimum.state, start):
        if inverted_fraction(minimum.state, system.lattice) == 0:
            break
        minimum = _minimise(state, system, delta, contraction, last, CONTACT)
        used += minimum.evaluations
    return minimum._replace(evaluations=used)


def _minimise(
    state: NDArray[Any],
    system: System,
    delta: float,
    contraction: Contraction,
    last: bool,
    contact: float = 0.0,
) -> Minimum:
    return minimise(
        state,
        system.network,
        system.walls,
        delta,
        tolerance=contraction.tolerance if last else 0.0,
        ftol=contraction.last_ftol if last else contraction.ftol,
        thorough=last and contraction.last_ftol >= 0,
        contact=contact,
        max_evaluations=contraction.max_evaluations if last else contraction.step_evaluations,
    )


def agitate(
    state: NDArray[Any], system: System, delta: float, sweeps: int, rng: Generator, warmth: float = 1.0
) -> NDArray[Any]:
    """The state after a short anneal from `warmth` times the temperature of agitation."""
    if delta == 0:
        return state
    return anneal(
        state,
        system.order,
        system.sublattices,
        system.walls,
        delta,
        rng,
        sweeps=sweeps,
        initial_temperature=warmth * agitation_temperature(delta),
        temperature_factor=COOLING,
    ).state


def refine(
    minimum: Minimum,
    system: System,
    delta: float,
    contraction: Contraction,
    rng: Generator,
    *,
    hops: int,
    sweeps: int,
) -> Minimum:
    """Agitate and minimise repeatedly, keeping states that are lower, converged and not more inverted.

    Basin hopping (D. Wales and J. Doye, J. Phys. Chem. A 101, 5111, 1997, doi:10.1021/jp970984n):
    removes boundaries between domains of orientation.
    """
    used = minimum.evaluations
    for _ in range(hops):
        agitated = agitate(minimum.state, system, delta, sweeps, rng, HOP_WARMTH)
        found = _minimise(agitated, system, delta, contraction, last=True)
        found = _without_inversion(found, minimum.state, system, delta, contraction, last=True)
        used += found.evaluations
        lower = found.energy + found.wall_energy < minimum.energy + minimum.wall_energy
        inverted = inverted_fraction(found.state, system.lattice)
        no_more = inverted <= inverted_fraction(minimum.state, system.lattice)
        if lower and no_more and found.converged >= minimum.converged:
            minimum = found
    return minimum._replace(evaluations=used)
