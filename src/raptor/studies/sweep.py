"""Contraction over a grid of parameters, simulated and predicted."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.dataset.design import Run
from raptor.dataset.netcdf import create, open_file, variable
from raptor.dataset.stack import read_samples, read_table
from raptor.moulds.geometry import Mould
from raptor.parameters import PARAMETERS, CellParameters
from raptor.surrogate.bands import LEVELS
from raptor.symmetry import FIELDS

if TYPE_CHECKING:
    from raptor.surrogate.inference import Surrogate

POINT = ["mould", "delta", "kappa_nnn", "ratio"]
SHAPES = ("area_ratio", "width_ratio")
MEASURES = {"width": "width_ratio", "area": "area_ratio"}
"""Percentage decreases, and the ratio from which each is computed."""
Point = tuple[float, float, float]
"""Delta, kappa_nnn, kappa_nnnn / kappa_nnn."""
SHOWN = (0.5, 0.9)
"""Values of delta whose tissues are drawn, as in the paper, or the nearest ones."""


def ratio_of(parameters: CellParameters) -> float:
    """kappa_nnnn / kappa_nnn."""
    return round(parameters.kappa_nnnn / parameters.kappa_nnn, 9)


def tabulate(stack: Path) -> pd.DataFrame:
    """Measures of every simulation of a campaign's stack, one row each, without failed ones.

    Raises
    ------
    RaptorError
        If the file is missing or is no stack.
    """
    table = read_table(stack)
    columns: dict[str, Any] = {"simulation": table.simulation, "mould": table.mould}
    columns |= {name: [getattr(p, name) for p in table.parameters] for name in PARAMETERS}
    columns["ratio"] = [ratio_of(p) for p in table.parameters]
    columns |= {"seed": table.seed, "n_cells": table.n_cells, "converged": table.converged.astype(bool)}
    return pd.DataFrame(columns | dict(table.measures))


def predict(
    surrogate: "Surrogate",
    runs: Sequence[Run],
    moulds: Mapping[str, Mould],
    on_progress: Callable[[str], None] = lambda point: None,
) -> tuple[pd.DataFrame, dict[int, NDArray[np.float32]]]:
    """A/A0 and w/w0 with 95 % bands at every point of a campaign, and fields (8, y, x) to be drawn.

    Fields by row of the table, at the values of delta nearest to `SHOWN`.

    Raises
    ------
    RaptorError
        If the surrogate is not calibrated.
    """
    widest, shown = LEVELS.index(0.95), shown_deltas([run.parameters.delta for run in runs])
    casts = {name: surrogate.cast(mould) for name, mould in moulds.items()}
    rows: list[dict[str, Any]] = []
    fields: dict[int, NDArray[np.float32]] = {}
    for mould, parameters in dict.fromkeys((run.mould, run.parameters) for run in runs):
        predicted = surrogate.examine(casts[mould], parameters)
        point = (mould, parameters.delta, parameters.kappa_nnn, ratio_of(parameters))
        row: dict[str, Any] = dict(zip(POINT, point, strict=True))
        row |= dict(zip(SHAPES, predicted.ratios.tolist(), strict=True))
        bands = predicted.measure_bands.half[widest, :2].tolist()
        row |= {f"{name}_band95": band for name, band in zip(SHAPES, bands, strict=True)}
        if parameters.delta in shown:
            fields[len(rows)] = predicted.values
        rows.append(row | {"out_of_distribution": predicted.out_of_distribution})
        on_progress(f"{mould}, {parameters}")
    return pd.DataFrame(rows), fields


def contraction(simulated: pd.DataFrame, predicted: pd.DataFrame | None = None) -> pd.DataFrame:
    """Contraction in per cent, simulated and predicted, one row per point and measure.

    Columns: `mould`, `measure` (width or area), the point, `simulated` (mean over seeds), `spread` (standard
    deviation over seeds, NaN for a single one), `seeds`, `predicted`, `band95`, `difference` (predicted minus
    simulated), `within_band` (whether the band covers the mean) and
    `out_of_distribution`, the surrogate's own warning.
    Without a prediction the numbers among the last ones are empty, and the other two false.
    """
    if predicted is None:
        nothing = dict.fromkeys((*SHAPES, *(f"{name}_band95" for name in SHAPES)), np.nan)
        predicted = simulated[POINT].drop_duplicates().assign(**nothing, out_of_distribution=False)
    there = predicted.set_index(POINT)
    tables = []
    for measure, ratio in MEASURES.items():
        of_point = (100 * (1 - simulated.set_index(POINT)[ratio])).groupby(level=POINT)
        table = pd.DataFrame({"measure": measure}, index=there.index)
        table["simulated"], table["spread"] = of_point.mean(), of_point.std()
        table["seeds"] = of_point.count().reindex(there.index, fill_value=0)
        table["predicted"] = 100 * (1 - there[ratio])
        table["band95"] = 100 * there[f"{ratio}_band95"]
        table["difference"] = table["predicted"] - table["simulated"]
        table["within_band"] = table["difference"].abs() <= table["band95"]
        table["out_of_distribution"] = there["out_of_distribution"]
        tables.append(table.reset_index())
    joined = pd.concat(tables, ignore_index=True)
    return joined.set_index(["mould", "measure"]).reset_index()


def differences(table: pd.DataFrame) -> list[dict[str, Any]]:
    """For each mould and measure of `contraction`, the largest difference, its position, and the means.

    Differences in percentage points; `spread` is the root mean variance over seeds.
    """
    found = []
    for (mould, measure), part in table.groupby(["mould", "measure"], sort=False):
        known = part.dropna(subset=["difference"])
        entry: dict[str, Any] = {"mould": str(mould), "measure": str(measure), "points": len(known)}
        if len(known):
            worst = known.sort_values("difference", key=np.abs).iloc[-1]
            shown = (*POINT[1:], "simulated", "predicted", "band95", "difference")
            entry["largest"] = {name: float(worst[name]) for name in shown}
            entry["mean_absolute"] = float(known["difference"].abs().mean())
            entry["bias"] = float(known["difference"].mean())
            entry["spread"] = _finite(np.sqrt((known["spread"] ** 2).mean()))
            entry["within_band"] = float(known["within_band"].mean())
            entry["out_of_distribution"] = float(known["out_of_distribution"].mean())
        found.append(entry)
    return found


def _finite(value: float) -> float | None:
    """A number in the types of JSON."""
    return float(value) if np.isfinite(value) else None


def shown_deltas(deltas: Sequence[float]) -> tuple[float, ...]:
    """The values of delta nearest to `SHOWN`."""
    return tuple(sorted({min(deltas, key=lambda delta: abs(delta - wanted)) for wanted in SHOWN}))


@dataclass(frozen=True)
class Panel:
    """Fields (8, y, x) at one point of a sweep, by source: simulated with the first seed, and predicted."""

    mould: str
    point: Point
    sources: Mapping[str, NDArray[np.float32]]


def write_predicted(
    path: Path, table: pd.DataFrame, fields: Mapping[int, NDArray[np.float32]], threshold: float
) -> None:
    """Write predicted fields (8, y, x), by row of the table of their points, as netCDF."""
    chosen = table.iloc[list(fields)]
    stacks = np.array(list(fields.values()))
    with create(path, "Fields of a sweep, predicted", "prediction") as file:
        file.threshold = threshold  # density per pixel above which there is tissue
        sizes = zip(("point", "field", "y", "x"), stacks.shape, strict=True)
        for name, size in sizes:
            file.createDimension(name, size)
        variable(file, "field", ("field",), np.array(FIELDS), "name of the field")
        for name in POINT:
            variable(file, name, ("point",), chosen[name].to_numpy(), name)
        variable(file, "fields", ("point", "field", "y", "x"), stacks, "fields, per pixel")


def read_panels(
    stack: Path, mould: str, predicted: Path | None = None
) -> tuple[list[Panel], dict[str, float]]:
    """Tissues of one mould to be drawn, without failed simulations, and thresholds by source.

    Raises
    ------
    RaptorError
        If all of them failed, or a file cannot be read.
    """
    table = read_table(stack)
    first: dict[Point, int] = {}
    for row, parameters in enumerate(table.parameters):
        if table.mould[row] == mould:
            point = (parameters.delta, parameters.kappa_nnn, ratio_of(parameters))
            first.setdefault(point, row)
    if not first:
        raise RaptorError(f"every simulation of {mould} failed; see the logs of simulate_shard")
    shown = shown_deltas([point[0] for point in first])
    chosen = {point: row for point, row in first.items() if point[0] in shown}
    of_surrogate, thresholds = _read_predicted(predicted, mould) if predicted else ({}, {})
    panels = []
    for point, sample in zip(chosen, read_samples(stack, chosen.values()), strict=True):
        sources = {"simulated": sample.fields}
        if point in of_surrogate:
            sources["predicted"] = of_surrogate[point]
        panels.append(Panel(mould, point, sources))
    return panels, thresholds | {"simulated": table.threshold}


def _read_predicted(path: Path, mould: str) -> tuple[dict[Point, NDArray[np.float32]], dict[str, float]]:
    """Predicted fields (8, y, x) of a mould, by point."""
    with open_file(path) as file:
        columns = zip(*(file[name][:] for name in POINT), strict=True)
        found = {
            (float(delta), float(kappa_nnn), float(ratio)): file["fields"][row]
            for row, (name, delta, kappa_nnn, ratio) in enumerate(columns)
            if str(name) == mould
        }
        return found, {"predicted": float(file.threshold)}


def middle_points(panels: Sequence[Panel]) -> list[Panel]:
    """For each value of delta, the tissue in the middle of the spring constants."""
    kappas, ratios = (sorted({panel.point[axis] for panel in panels}) for axis in (1, 2))
    middle = (kappas[len(kappas) // 2], ratios[len(ratios) // 2])
    return [panel for panel in panels if panel.point[1:] == middle]
