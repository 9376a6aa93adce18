"""Speed against accuracy: what each accuracy level, and the surrogate, costs and gets wrong."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from raptor.condor.accuracy import Simulation, simulate
from raptor.dataset.design import Run
from raptor.fields import rasterise
from raptor.morphology import area_ratio, density_threshold, width_ratio
from raptor.moulds.geometry import Mould
from raptor.moulds.raster import mould_image
from raptor.parameters import NetworkModel
from raptor.surrogate.inference import Surrogate


@dataclass(frozen=True)
class Reference:
    """Several reference runs of one mould, of different seeds, and what they agree on.

    Parameters
    ----------
    stacks : list of ndarray (8, y, x)
        Fields of each run.
    shape : ndarray (2,)
        Mean A/A0 and w/w0.
    """

    stacks: list[NDArray[np.float64]]
    shape: NDArray[np.float64]

    @property
    def spread(self) -> NDArray[np.float64]:
        """Seed-to-seed spread of each field (8,): what no prediction of a single run can beat.

        Root mean square over pixels of the difference of two runs, over sqrt 2, averaged over
        pairs.
        """
        pairs = [_distance(a, b) for a, b in combinations(self.stacks, 2)]
        return np.asarray(np.mean(pairs, axis=0) / np.sqrt(2))

    def field_error(self, fields: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance of fields (8, y, x) to single runs, in units of the spread (8,).

        The mean of very many runs, the best of predictions, scores 1; another run scores sqrt 2.
        """
        return np.asarray(np.mean([_distance(fields, s) for s in self.stacks], axis=0) / self.spread)


@dataclass(frozen=True)
class Case:
    """A mould, its parameters, and the setting of a comparison."""

    run: Run
    mould: Mould
    model: NetworkModel
    pixels: int

    def simulate(self, accuracy: str, seed: int) -> Simulation:
        """One run at an accuracy."""
        return simulate(self.mould, self.run.parameters, self.model, accuracy, seed)

    def fields(self, s: Simulation) -> NDArray[np.float64]:
        """Its fields (8, y, x)."""
        return rasterise(s.positions, s.orientation, s.tension, self.pixels)

    def shape(self, fields: NDArray[np.floating]) -> NDArray[np.float64]:
        """A/A0 and w/w0 of fields (8, y, x)."""
        threshold = density_threshold(self.model.layers, self.pixels)
        image = mould_image(self.mould, self.pixels)
        return np.array(
            [area_ratio(fields[0], image, threshold), width_ratio(fields[0], self.mould, threshold)]
        )


def spread_over_delta(runs: list[Run], count: int) -> list[Run]:
    """So many held-out runs, from the least Delta to the largest, evenly by rank."""
    held_out = sorted((r for r in runs if r.split == "test"), key=lambda run: run.parameters.delta)
    return [held_out[i] for i in np.linspace(0, len(held_out) - 1, count).round().astype(int)]


def compare(
    cases: list[Case],
    accuracies: tuple[str, ...],
    seeds: int,
    surrogate: Surrogate,
    done: Callable[[str], None] = lambda what: None,
) -> pd.DataFrame:
    """One row a mould and method: cost, energy, and the errors of fields and shapes.

    Energies are per cell, kappa0 l0^2, and above the least that any run of the mould reached.
    """
    rows = []
    for case in cases:
        runs = []
        for offset in range(1, seeds + 1):
            runs.append(case.simulate("reference", case.run.seed + offset))
            done(f"{case.run.mould}, reference {offset}")
        stacks = [case.fields(s) for s in runs]
        shape = np.mean([case.shape(stack) for stack in stacks], axis=0)
        reference = Reference(stacks, shape)
        simulations = []
        for name in accuracies:
            started = time.process_time()
            s = case.simulate(name, case.run.seed)
            seconds = time.process_time() - started
            simulations.append(s)
            rows.append(
                _row(case, reference, name, case.fields(s), seconds)
                | {"energy_per_cell": s.energy / s.cells}
                | {"converged": s.converged, "folded_fraction": s.folded_fraction}
            )
            done(f"{case.run.mould}, {name}")
        best = min(s.energy / s.cells for s in (*runs, *simulations))
        for row in rows[-len(accuracies) :]:
            row["energy_above_best"] = row["energy_per_cell"] - best
        started = time.process_time()
        predicted = surrogate.predict_mould(case.mould, case.run.parameters)
        rows.append(_row(case, reference, "surrogate", predicted, time.process_time() - started))
    return pd.DataFrame(rows)


def _row(
    case: Case, reference: Reference, method: str, fields: NDArray[np.floating], seconds: float
) -> dict[str, Any]:
    errors = reference.field_error(fields.astype(np.float64))
    area_error, width_error = case.shape(fields) - reference.shape
    return {
        "simulation": case.run.simulation,
        "method": method,
        "core_seconds": seconds,
        "density_error": float(errors[0]),
        "tension_error": float(errors[1]),
        "area_error": float(area_error),
        "width_error": float(width_error),
    }


def _distance(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Root mean square over pixels of the difference of two stacks, a field (8,)."""
    return np.asarray(np.sqrt(((a - b) ** 2).mean(axis=(1, 2))))
