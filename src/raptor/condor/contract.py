"""Quasi-static contraction, and its one-step draft.

`contract` follows the cast lattice as the gel does: Delta rises to its value in steps, and at each
step positions and orientations are minimised together. Starting hot, or at the full Delta, can
fold the network through itself; following the contraction does not.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raptor.condor.minimise import Minimum, minimise
from raptor.condor.network import Network
from raptor.condor.walls import Walls


@dataclass(frozen=True)
class Contraction:
    """How closely the contraction is followed.

    Parameters
    ----------
    steps : int
        Steps from Delta = 0 to its value; 1 minimises at the full Delta at once (`relax`).
    step_tolerance, step_limit : float, int
        Largest gradient (kappa0 l0, over Delta) and evaluations at which a step before the last is left.
    tolerance, limit : float, int
        The same for the final minimisation.
    """

    steps: int
    step_tolerance: float
    step_limit: int
    tolerance: float
    limit: int


def contract(
    state: NDArray[np.float64],
    network: Network,
    walls: Walls,
    delta: float,
    contraction: Contraction,
) -> Minimum:
    """Contract a state (6 * cells,) to its Delta; evaluations are summed over all steps."""
    used = 0
    for step in range(1, contraction.steps):
        minimum = minimise(
            state,
            network,
            walls,
            delta * step / contraction.steps,
            tolerance=contraction.step_tolerance,
            limit=contraction.step_limit,
        )
        state = minimum.state
        used += minimum.evaluations
    minimum = minimise(state, network, walls, delta, tolerance=contraction.tolerance, limit=contraction.limit)
    return minimum._replace(evaluations=used + minimum.evaluations)
