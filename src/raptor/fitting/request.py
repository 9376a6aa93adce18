"""What a fit is asked for, and the models that answer it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from raptor.condor.simulate import Tissue
from raptor.fitting.least_squares import Residuals
from raptor.fitting.outline import Densities, Outline, outline_measure
from raptor.fitting.simulator import Simulator
from raptor.fitting.targets import Measure, Target, surrogate_densities, surrogate_measure
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters
from raptor.raster import density_threshold
from raptor.surrogate.inference import Surrogate

By = Literal["corrected", "surrogate", "simulator"]
"""The model used by a fit: the surrogate, with or without corrections by simulations, or the simulator."""


@dataclass(frozen=True)
class Request:
    """A request for a fit.

    Parameters
    ----------
    mould : Mould
    target : Target or Outline
        The measurement.
    simulator : Simulator
    surrogate : Surrogate or None
        None if the simulator starts from `start`.
    start : CellParameters or None
    by : str
        One of `By`.
    simulations : int
        Largest number of simulations.
    error : float or None
        Standard error of a ratio, or of the outline in l0; None for the default.
    on_progress : callable
        Called with a note about what was done.
    tissues : dict
        Simulated so far, by their parameters.
    """

    mould: Mould
    target: Target | Outline
    simulator: Simulator
    surrogate: Surrogate | None
    start: CellParameters | None
    by: By
    simulations: int
    error: float | None
    on_progress: Callable[[str], None]
    tissues: dict[CellParameters, Tissue] = field(default_factory=dict)

    def measure(self, densities: Densities, ratios: Measure, threshold: float) -> tuple[Measure, Residuals]:
        """The measured quantities and their residuals."""
        if isinstance(self.target, Outline):
            return outline_measure(densities, self.target, threshold), np.asarray
        return ratios, self.target.residuals

    def predicted(self, *, averaged: bool) -> tuple[Measure, Residuals]:
        """The measured quantities of predicted tissues, and their residuals."""
        assert self.surrogate is not None
        return self.measure(
            surrogate_densities(self.surrogate, self.mould, averaged=averaged, threads=None),
            surrogate_measure(self.surrogate, self.mould, averaged=averaged, threads=None),
            self.surrogate.threshold,
        )

    def simulated(self) -> tuple[Measure, Residuals]:
        """The measured quantities of simulated tissues, and their residuals."""
        cast = self.simulator.cast(self.mould)

        def densities(parameters: Sequence[CellParameters]) -> NDArray[np.float64]:
            return np.array([self.simulator.fields(self.simulate(each))[0] for each in parameters])

        def ratios(parameters: Sequence[CellParameters]) -> NDArray[np.float64]:
            return np.array([self.simulator.ratios(self.simulate(each), cast) for each in parameters])

        return self.measure(densities, ratios, density_threshold(cast.layers, cast.pixels))

    def simulate(self, parameters: CellParameters) -> Tissue:
        """A tissue with the seed of fits, simulated once."""
        if parameters not in self.tissues:
            self.tissues[parameters] = self.simulator.run(self.mould, parameters)
            self.on_progress(f"simulation {len(self.tissues)} of at most {self.simulations}")
        return self.tissues[parameters]
