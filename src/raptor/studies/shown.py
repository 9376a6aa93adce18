"""The held-out samples that figures show: simulated with several seeds, predicted, and drawn as samples."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from raptor.dataset.netcdf import create, variable
from raptor.dataset.stack import Sample, read_samples, read_table
from raptor.moulds.geometry import Mould
from raptor.parameters import PARAMETERS
from raptor.symmetry import FIELDS

if TYPE_CHECKING:  # tables and figures do not wait for torch
    from raptor.surrogate.inference import Surrogate

DRAWN = 3  # samples of each that a surrogate draws, if it samples


def median_and_worst(metrics: pd.DataFrame, count: int = 12) -> list[int]:
    """Simulations to be shown: that with the median error of density, then the worst, worst first."""
    ordered = metrics.sort_values("vrmse_density", ascending=False)["simulation"].tolist()
    return [ordered[(len(ordered) - 1) // 2], *ordered[:count]]


def predict_samples(
    path: Path,
    surrogate: "Surrogate",
    stack: Path,
    moulds: Mapping[str, Mould],
    chosen: pd.DataFrame,
    repeat: Callable[[Sample], Sequence[NDArray[np.floating]]],
    on_progress: Callable[[str], None] = lambda note: None,
) -> None:
    """Write samples of a stack as netCDF: simulated, simulated again, predicted, and drawn.

    Parameters
    ----------
    chosen : DataFrame
        Rows of `evaluate` by simulation, in the order in which samples are written.
    repeat : callable
        From a sample to densities (y, x) of the same tissue, simulated with other seeds.
    """
    table, along = read_table(stack), ("sample", "field", "y", "x")
    row_of = {simulation: row for row, simulation in enumerate(table.simulation.tolist())}
    samples = list(read_samples(stack, [row_of[simulation] for simulation in chosen.index]))
    predicted = [surrogate.predict(moulds[s.mould], [s.parameters])[0] for s in samples]
    again = []
    for sample in samples:
        again.append(repeat(sample))
        on_progress(f"simulation {sample.simulation}")
    drawn = np.array([_draw(surrogate, moulds[sample.mould], sample) for sample in samples])
    sizes = dict(zip(along, (len(samples), len(FIELDS), table.pixels, table.pixels), strict=True))
    sizes |= {"seed": len(again[0]), "draw": drawn.shape[1]}
    with create(path, "Held-out samples, simulated and predicted", "prediction") as file:
        for name, size in sizes.items():
            file.createDimension(name, size)
        variable(file, "field", ("field",), np.array(FIELDS), "name of the field")
        variable(file, "simulation", ("sample",), chosen.index.to_numpy(), "simulation id")
        variable(file, "mould", ("sample",), chosen["mould"].to_numpy(), "mould id")
        for name, text in (PARAMETERS | {"vrmse_density": "VRMSE of density"}).items():
            variable(file, name, ("sample",), chosen[name].to_numpy(), text)
        simulated = np.array([sample.fields for sample in samples])
        variable(file, "simulated", along, simulated, "simulated fields, per pixel")
        variable(file, "predicted", along, np.array(predicted), "predicted fields, per pixel")
        variable(file, "again", ("sample", "seed", "y", "x"), np.array(again), "density with other seeds")
        variable(file, "drawn", ("sample", "draw", "y", "x"), drawn, "density of samples by the surrogate")


def _draw(surrogate: "Surrogate", mould: Mould, sample: Sample) -> NDArray[np.float32]:
    """Densities (draws, y, x) of samples by a surrogate; none of one that gives one mean."""
    count = DRAWN if surrogate.architecture.noise else 0
    if not count:
        return np.empty((0, surrogate.pixels, surrogate.pixels), np.float32)
    return surrogate.sample(mould, sample.parameters, count, seed=sample.simulation)[:, 0]
