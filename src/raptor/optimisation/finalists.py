"""The moulds of a front that are simulated, beside others, and ranked by what the simulations say."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from raptor.condor.simulate import simulate
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.moulds.summary import symmetry_class
from raptor.optimisation.evaluation import Evaluator
from raptor.optimisation.measures import View, measure
from raptor.optimisation.search import Found, undominated
from raptor.optimisation.spec import DesignSpec

WIDER = 3  # times as many moulds as finalists are predicted by the whole ensemble
Report = Callable[[str], None]


def choose(found: Found, evaluator: Evaluator) -> tuple[list[Mould], pd.DataFrame]:
    """Finalists, spread over the front, and the front as the whole ensemble predicts it.

    Those that break a constraint once all networks are asked give way to those that break none.
    """
    spec = evaluator.spec
    some = spread(found.objectives, WIDER * spec.finalists)
    casts = [cast for vector in found.vectors[some] if (cast := evaluator.decode(vector).cast) is not None]
    front = predicted(casts, evaluator)
    costs = _costs(front, spec, "predicted")
    kept = (
        np.flatnonzero(front["predicted_meets"]) if front["predicted_meets"].any() else np.arange(len(front))
    )
    chosen = kept[spread(costs[kept], spec.finalists)]
    order = chosen[np.argsort(costs[chosen, 0], kind="stable")]
    moulds = []
    for number, row in enumerate(order, start=1):
        mould = casts[row].mould
        moulds.append(
            replace(mould, name=f"d{number:02d}", symmetry=symmetry_class(mould), family="designed")
        )
    return moulds, front.iloc[order].reset_index(drop=True)


def spread(points: NDArray[np.float64], count: int) -> NDArray[np.intp]:
    """Indices of up to `count` points (n, m): the best of each column, then the farthest from those."""
    if len(points) <= count:
        return np.arange(len(points))
    scaled = (points - points.min(axis=0)) / (np.ptp(points, axis=0) + 1e-12)
    chosen = list(dict.fromkeys(scaled.argmin(axis=0).tolist()))[:count]
    nearest = np.min([np.linalg.norm(scaled - scaled[each], axis=1) for each in chosen], axis=0)
    while len(chosen) < count:
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(scaled - scaled[chosen[-1]], axis=1))
    return np.sort(chosen)


def predicted(casts: Sequence[CastMould], evaluator: Evaluator) -> pd.DataFrame:
    """Each measure of moulds, mean and standard deviation over networks and images of D4, or samples."""
    surrogate = evaluator.surrogate
    values = evaluator.values(casts, 8 * len(surrogate.members))
    return _table(values, evaluator.spec, "predicted")


def simulated(
    moulds: Sequence[Mould], evaluator: Evaluator, report: Report = lambda note: None
) -> pd.DataFrame:
    """Each measure of moulds, mean and standard deviation over simulations with different seeds."""
    spec, surrogate = evaluator.spec, evaluator.surrogate
    pixels, labels = surrogate.architecture.pixels, [*spec.measured, "held"]
    values = {label: np.full((len(moulds), spec.simulations), np.nan) for label in labels}
    for number, mould in enumerate(moulds):
        view = View(surrogate.cast(mould), pixels)
        for seed in range(spec.simulations):
            tissue = simulate(mould, spec.parameters, surrogate.layers, spec.accuracy, seed)
            fields = tissue.rasterised(pixels)
            for label, what in spec.measured.items():
                if what.measure == "distance":
                    values[label][number, seed] = evaluator.distance(view.cast)
                elif what.measure != "held":
                    values[label][number, seed] = measure(what, fields, view, 1.0, spec.unit)
            values["held"][number, seed] = tissue.posts_lost == 0
            report(f"{mould.name}, seed {seed}: {tissue}")
    return _table(values, spec, "simulated")


def ranked(table: pd.DataFrame, spec: DesignSpec) -> pd.DataFrame:
    """Rows with their `rank`: 1 on the front by simulation, 2 on the next, ...; none where limits are broken.

    By prediction where nothing was simulated.
    """
    by = "simulated" if "simulated_meets" in table else "predicted"
    costs, left, rank = _costs(table, spec, by), np.flatnonzero(table[f"{by}_meets"]), 1
    found = np.full(len(table), np.nan)
    while len(left):
        front = left[undominated(costs[left])]
        found[front] = rank
        left, rank = np.setdiff1d(left, front), rank + 1
    ranks = pd.array([None if np.isnan(each) else int(each) for each in found], dtype="Int64")
    return table.assign(rank=ranks)


def best_of(moulds: Sequence[Mould], evaluator: Evaluator) -> list[Mould]:
    """Of moulds to compare with, the one predicted best in each objective; all of them if they are few."""
    if len(moulds) <= len(evaluator.spec.objectives):
        return list(moulds)
    casts = [evaluator.surrogate.cast(mould) for mould in moulds]
    costs = _costs(_table(evaluator.values(casts), evaluator.spec, "predicted"), evaluator.spec, "predicted")
    return [moulds[number] for number in dict.fromkeys(np.nanargmin(costs, axis=0).tolist())]


def _table(values: Mapping[str, NDArray[np.float64]], spec: DesignSpec, by: str) -> pd.DataFrame:
    """Means and standard deviations of values (n, m) by label, and whether the constraints are met."""
    columns: dict[str, NDArray[np.float64]] = {}
    for label, each in values.items():
        columns[f"{by}_{label}"] = each.mean(axis=1)
        if label != "distance" and each.shape[1] > 1:
            columns[f"{by}_{label}_std"] = each.std(axis=1, ddof=1)
    meets = np.ones(len(values["held"]), dtype=bool)
    for limit in spec.constraints:
        mean = columns[f"{by}_{limit.label}"]
        low = -np.inf if limit.at_least is None else limit.at_least
        high = np.inf if limit.at_most is None else limit.at_most
        meets &= np.asarray((low <= mean) & (mean <= high))
    return pd.DataFrame(columns | {f"{by}_meets": meets})


def _costs(table: pd.DataFrame, spec: DesignSpec, by: str) -> NDArray[np.float64]:
    """The objectives (n, objectives), smaller is better."""
    columns = [each.sign * table[f"{by}_{each.label}"].to_numpy(dtype=float) for each in spec.objectives]
    return np.column_stack(columns)
