"""Contraction over a grid of parameters: what was simulated, what is predicted, and how far they differ."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.dataset.design import Run
from raptor.dataset.shards import Record, read_shard
from raptor.dataset.stack import record_fields
from raptor.dataset.sweep import Grid
from raptor.fields.shape import shape_ratios
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters
from raptor.surrogate.bands import LEVELS

if TYPE_CHECKING:  # tables and figures do not wait for torch
    from raptor.surrogate.inference import Surrogate

POINT = ["delta", "kappa_nnn", "ratio"]
SHAPES = ("area_ratio", "width_ratio")
MEASURES = {"width": "width_ratio", "area": "area_ratio"}
"""Percentage decreases, and the ratio that each follows from."""

Point = tuple[float, float, float]
"""Delta, kappa_nnn, kappa_nnnn / kappa_nnn."""


def point_of(parameters: CellParameters) -> Point:
    """The point of a grid at which parameters stand."""
    ratio = round(parameters.kappa_nnnn / parameters.kappa_nnn, 9)
    return parameters.delta, parameters.kappa_nnn, ratio


def _records(shards: Iterable[Path], configuration: str | None) -> Iterable[Record]:
    """The simulations of shards, one shard in memory at a time."""
    for path in shards:
        yield from read_shard(path, configuration).records


def measure(
    shards: Iterable[Path],
    mould: Mould,
    layers: int,
    pixels: int,
    configuration: str | None = None,
    on_progress: Callable[[int], None] = lambda simulation: None,
) -> pd.DataFrame:
    """A/A0 and w/w0 of every simulation of a sweep, one row each; those that failed have none.

    Raises
    ------
    RaptorError
        As `read_shard`.
    """
    rows = []
    cast = CastMould(mould, layers, pixels)
    for record in _records(shards, configuration):
        shape = shape_ratios(record_fields(record, pixels)[0], cast).tolist()
        row: dict[str, Any] = {"simulation": record.simulation, "seed": record.seed}
        row |= dict(zip(POINT, point_of(record.parameters), strict=True))
        row |= dict(zip(SHAPES, shape, strict=True))
        row |= {"converged": record.converged, "inverted_fraction": record.inverted_fraction}
        rows.append(row)
        on_progress(record.simulation)
    columns = ["simulation", "seed", *POINT, *SHAPES, "converged", "inverted_fraction"]
    return pd.DataFrame(rows, columns=columns)


def predict(
    surrogate: "Surrogate",
    mould: Mould,
    grid: Grid,
    on_progress: Callable[[Point], None] = lambda point: None,
) -> pd.DataFrame:
    """A/A0 and w/w0 at every point of a grid as the surrogate predicts them, with its 95 % bands.

    Raises
    ------
    RaptorError
        Where the surrogate is not calibrated.
    """
    rows = []
    widest = LEVELS.index(0.95)
    cast = surrogate.cast(mould)
    for parameters in grid.points.values():
        point = point_of(parameters)
        predicted = surrogate.examine(cast, parameters)
        row: dict[str, Any] = dict(zip(POINT, point, strict=True))
        row |= dict(zip(SHAPES, predicted.ratios.tolist(), strict=True))
        bands = predicted.ratio_bands.half[widest].tolist()
        row |= {f"{name}_band95": band for name, band in zip(SHAPES, bands, strict=True)}
        rows.append(row | {"unlike": predicted.out_of_distribution})
        on_progress(point)
    return pd.DataFrame(rows)


def compare(mould: str, simulated: pd.DataFrame, predicted: pd.DataFrame) -> pd.DataFrame:
    """Contraction in per cent, simulated and predicted: a row for each point of the grid and measure.

    Columns: `mould`, `measure` (width or area), the point, `simulated` (mean over seeds), `spread` (standard
    deviation over seeds, NaN of a single one), `seeds`, `predicted`, `band95`, `difference` (predicted less
    simulated), `held` (whether the band holds the mean) and `unlike`, the surrogate's own warning.
    """
    tables = []
    for measure_name, ratio in MEASURES.items():
        of_point = (100 * (1 - simulated.set_index(POINT)[ratio])).groupby(level=POINT)
        table = predicted[[*POINT, "unlike"]].set_index(POINT)
        table["simulated"] = of_point.mean()
        table["spread"] = of_point.std()
        table["seeds"] = of_point.count().reindex(table.index, fill_value=0)
        there = predicted.set_index(POINT)
        table["predicted"] = 100 * (1 - there[ratio])
        table["band95"] = 100 * there[f"{ratio}_band95"]
        table["difference"] = table["predicted"] - table["simulated"]
        table["held"] = table["difference"].abs() <= table["band95"]
        tables.append(table.reset_index().assign(mould=mould, measure=measure_name))
    joined = pd.concat(tables, ignore_index=True)
    return joined.set_index(["mould", "measure", *POINT]).reset_index()


def differences(table: pd.DataFrame) -> list[dict[str, Any]]:
    """For each mould and measure of `compare`: the largest difference and where it is, and the means.

    Differences in percentage points; `spread` is the root mean variance over seeds.
    """
    found = []
    for (mould, measure_name), part in table.groupby(["mould", "measure"], sort=False):
        known = part.dropna(subset=["difference"])
        entry: dict[str, Any] = {"mould": str(mould), "measure": str(measure_name), "points": len(known)}
        if len(known):
            worst = known.sort_values("difference", key=np.abs).iloc[-1]
            entry["largest"] = {
                name: float(worst[name])
                for name in (*POINT, "simulated", "predicted", "band95", "difference")
            }
            entry["mean_absolute"] = float(known["difference"].abs().mean())
            entry["bias"] = float(known["difference"].mean())
            entry["spread"] = _finite(np.sqrt((known["spread"] ** 2).mean()))
            entry["held"] = float(known["held"].mean())
            entry["unlike"] = float(known["unlike"].mean())
        found.append(entry)
    return found


def _finite(value: float) -> float | None:
    """A number as JSON has it."""
    return float(value) if np.isfinite(value) else None


def middle_points(grid: Grid, deltas: Sequence[float]) -> list[Point]:
    """The points at some Deltas in the middle of a grid's spring constants."""
    kappa, ratio = (values[len(values) // 2] for values in (grid.kappa_nnn, grid.ratios))
    return [(delta, kappa, ratio) for delta in deltas]


@dataclass(frozen=True)
class Tissue:
    """Fields (8, y, x) at one point of a sweep: of the first seed's simulation, and predicted."""

    point: Point
    simulated: NDArray[np.float32]
    predicted: NDArray[np.float32]

    @property
    def sources(self) -> dict[str, NDArray[np.float32]]:
        """Both, by name."""
        return {"simulated": self.simulated, "predicted": self.predicted}


def tissues(
    points: Sequence[Point],
    shards: Iterable[Path],
    runs: Sequence[Run],
    mould: Mould,
    surrogate: "Surrogate",
    configuration: str | None = None,
) -> list[Tissue]:
    """Tissues at some points of a sweep, in the order of `points`; without those whose simulation failed.

    Raises
    ------
    RaptorError
        As `read_shard`, and where all of them failed.
    """
    first: dict[Point, Run] = {}
    for run in runs:
        first.setdefault(point_of(run.parameters), run)
    wanted = {first[point].simulation: point for point in points}
    found = {}
    cast = surrogate.cast(mould)
    for record in _records(shards, configuration):
        if record.simulation in wanted:
            simulated = record_fields(record, surrogate.pixels)
            predicted = surrogate.predict(cast, [record.parameters])[0]
            point = wanted[record.simulation]
            found[point] = Tissue(point, simulated, predicted)
    if not found:
        raise RaptorError(
            f"every simulation of {mould.name} to be drawn failed; see the logs of simulate_sweep for why"
        )
    return [found[point] for point in points if point in found]
