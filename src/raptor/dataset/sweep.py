"""Sweeps: one mould at every point of a grid of parameters, each with several seeds (paper, "Results")."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from raptor.dataset.design import Run
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters

STREAM = 17  # of a sweep's random numbers, beside those of the design and of further sets


@dataclass(frozen=True)
class Grid:
    """The points of a sweep.

    Parameters
    ----------
    deltas, kappa_nnn : tuple of float
        Values of Delta, and of kappa_nnn in kappa0.
    ratios : tuple of float
        Values of kappa_nnnn / kappa_nnn.
    seeds : int
        Simulations of each point.

    Raises
    ------
    RaptorError
        Where a point lies outside what the surrogate is trained on.
    """

    deltas: tuple[float, ...]
    kappa_nnn: tuple[float, ...]
    ratios: tuple[float, ...]
    seeds: int = 1

    def __post_init__(self) -> None:
        for parameters in self.points.values():
            parameters.require_sampled("sweep")

    @property
    def points(self) -> dict[tuple[float, float, float], CellParameters]:
        """Parameters of each point, by (delta, kappa_nnn, ratio)."""
        return {
            (delta, kappa, ratio): CellParameters(delta, kappa, round(kappa * ratio, 12))
            for delta, kappa, ratio in product(self.deltas, self.kappa_nnn, self.ratios)
        }

    @property
    def size(self) -> int:
        """Simulations in all."""
        return self.seeds * len(self.points)


def sweep_runs(grid: Grid, mould: Mould, seed: int) -> list[Run]:
    """A run for every point and seed of a grid; all are held out.

    Random numbers come from (root seed, mould's name, number of the run) alone.
    """
    stream = [seed, STREAM, *mould.name.encode()]
    runs = []
    for number, (parameters, _) in enumerate(product(grid.points.values(), range(grid.seeds))):
        rng = np.random.default_rng([*stream, number])
        runs.append(Run(number, mould.name, "test", False, parameters, int(rng.integers(2**53))))
    return runs
