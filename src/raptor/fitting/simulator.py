"""Fits by the simulator itself, and verification at fitted parameters.

The area ratio of a simulation varies with its seed by about 0.003. Within a fit all points share one seed
(common random numbers), so that differences between points are due to the parameters; verification uses
new seeds.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raptor.condor.simulate import Tissue, simulate
from raptor.fields.shape import shape_ratios
from raptor.fitting.least_squares import Minimum, Residuals, descend
from raptor.fitting.targets import Measure, Target
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters, NetworkModel
from raptor.raster import rasterise

STEP = 0.06  # of a finite difference, over a bound's width: ratios change by ten times their noise
RESTART = 5  # evaluations needed to make a step from another start
REPLICATES = 4  # simulations with new seeds to verify a fit
ENOUGH = 1e-5  # residual sum of squares due to a seed-to-seed noise of 0.003


@dataclass(frozen=True)
class Simulator:
    """How tissues are simulated.

    Parameters
    ----------
    model : NetworkModel
    accuracy : str
        As in `condor.simulate`.
    pixels : int
        Side of the image in which shapes are measured.
    seed : int
        Of every simulation, except for verification.
    """

    model: NetworkModel
    accuracy: str
    pixels: int
    seed: int

    @classmethod
    def configured(cls, content: Mapping[str, Any]) -> "Simulator":
        """From a configuration's layers, shells, tension, accuracy, pixels and seed."""
        model = NetworkModel.configured(content)
        return cls(model, content["accuracy"], content["pixels"], content["seed"] % 2**31)

    def seed_of(self, replicate: int) -> int:
        """The seed of fits (0) or of the nth replicate."""
        return (self.seed + replicate) % 2**31

    def run(self, mould: Mould, parameters: CellParameters, replicate: int = 0) -> Tissue:
        """Simulate a tissue, with the seed of fits (0) or of the nth replicate."""
        return simulate(mould, parameters, self.model, self.accuracy, self.seed_of(replicate))

    def replicates(self, mould: Mould, parameters: CellParameters, count: int) -> list[Tissue]:
        """Simulate a tissue with so many seeds, none of them that of fits."""
        return [self.run(mould, parameters, replicate) for replicate in range(1, count + 1)]

    def fields(self, simulation: Tissue) -> NDArray[np.float64]:
        """The eight fields (8, y, x) of a simulated tissue."""
        return rasterise(simulation.positions, simulation.orientation, simulation.tension, self.pixels)

    def cast(self, mould: Mould | CastMould) -> CastMould:
        """A mould as cast for simulations; one already cast is returned as is."""
        return CastMould(mould, self.model.layers, self.pixels) if isinstance(mould, Mould) else mould

    def ratios(self, simulation: Tissue, mould: Mould | CastMould) -> NDArray[np.float64]:
        """A/A0 and w/w0 of a simulated tissue, (2,)."""
        return shape_ratios(self.fields(simulation)[0], self.cast(mould))

    def measure(self, mould: Mould) -> Measure:
        """Area and width ratio of a mould's tissue, simulated with one common seed."""
        cast = self.cast(mould)

        def measure(parameters: Sequence[CellParameters]) -> NDArray[np.float64]:
            return np.array([self.ratios(self.run(mould, each), cast) for each in parameters])

        return measure


def descend_by_simulation(
    measure: Measure, residuals: Residuals, start: NDArray[np.float64], budget: int
) -> Minimum:
    """Fit by simulations, from a point (3,) of the unit cube, within a budget of points.

    If the search ends before its budget, it restarts from the other side of the valley: at the best point's
    delta, with spring constants mirrored in their ranges.
    """
    rules: dict[str, float] = {"step": STEP, "enough": ENOUGH, "tolerance": STEP / 10}
    first = descend(measure, residuals, start, budget=budget, **rules)
    left = budget - first.evaluations
    if first.rss < ENOUGH or left < RESTART:
        return first
    mirrored = np.array([first.unit[0], 1 - first.unit[1], 1 - first.unit[2]])
    second = descend(measure, residuals, mirrored, budget=left, **rules)
    best = min(first, second, key=lambda found: found.rss)
    return replace(best, evaluations=first.evaluations + second.evaluations)


def measure_again(
    simulations: Sequence[Tissue], simulator: Simulator, mould: Mould, target: Target
) -> dict[str, Any]:
    """Means and standard deviations of ratios over simulations of one tissue, and the rss of the means.

    `rss_std` is the standard deviation of the residual sum of squares of single simulations.
    """
    cast = simulator.cast(mould)
    ratios = np.array([simulator.ratios(simulation, cast) for simulation in simulations])
    mean, deviation = ratios.mean(axis=0), _deviation(ratios)
    single = np.array([target.rss(each) for each in ratios])
    return {
        "area_ratio": float(mean[0]),
        "width_ratio": float(mean[1]),
        "rss": target.rss(mean),
        "area_ratio_std": float(deviation[0]),
        "width_ratio_std": float(deviation[1]),
        "rss_std": float(_deviation(single[:, None])[0]),
        "runs": len(simulations),
        "converged": sum(simulation.converged for simulation in simulations),
    }


def _deviation(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviation over the first axis; 0 for a single value."""
    return values.std(axis=0, ddof=1) if len(values) > 1 else np.zeros(values.shape[1])
