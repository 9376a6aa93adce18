"""Errors of surrogates on held-out simulations, absolute and relative to the noise floor."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import asdict
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.dataset.stack import Sample, read_samples, read_table
from raptor.fields.directors import alignment, anisotropy
from raptor.fields.metrics import BULK, bulk_statistics, field_pearson, nrmse, pearson, vrmse, without_sign
from raptor.fields.shape import shape_ratios
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.studies.scores import scores, summary_of
from raptor.surrogate.bands import LEVELS, MEASURED
from raptor.surrogate.prediction import Prediction
from raptor.symmetry import FIELDS

if TYPE_CHECKING:  # tables and figures do not wait for torch
    from raptor.surrogate.inference import Surrogate

MEASURES = (*BULK, "area_ratio", "width_ratio", "alignment", "anisotropy")
SHAPES = ("area_ratio", "width_ratio")
ERRORS = ("vrmse", "masked_vrmse", "nrmse", "pearson")
REGIONS: dict[str, Callable[[pd.DataFrame], pd.Series]] = {
    "all": lambda table: table["delta"] > 0,
    "delta below 0.3": lambda table: table["delta"] < 0.3,
    "delta 0.3 to 0.6": lambda table: table["delta"].between(0.3, 0.6, inclusive="left"),
    "delta 0.6 to 0.9": lambda table: table["delta"].between(0.6, 0.9, inclusive="left"),
    "delta above 0.9": lambda table: table["delta"] >= 0.9,
    "kappa_nnn below 0.3": lambda table: table["kappa_nnn"] < 0.3,
    "kappa_nnnn below 0.1": lambda table: table["kappa_nnnn"] < 0.1,
    "soft: delta above 0.8, kappa_nnn below 0.3": lambda table: (
        (table["delta"] >= 0.8) & (table["kappa_nnn"] < 0.3)
    ),
}
"""Regions of the parameters, each a mask of a table's rows."""

Guess = NDArray[np.floating] | Prediction
Predictor = Callable[[Sample, CastMould], Guess]


def sample_measures(fields: NDArray[np.floating], cast: CastMould) -> dict[str, float]:
    """Bulk statistics and measures of fields (8, y, x) of a mould's tissue, keyed by `MEASURES`."""
    own = (*shape_ratios(fields[0], cast).tolist(), alignment(fields, cast), anisotropy(fields))
    return bulk_statistics(fields, cast.n_cells, cast.threshold) | dict(
        zip(MEASURES[len(BULK) :], own, strict=True)
    )


def predictor_of(surrogate: "Surrogate") -> Predictor:
    """A surrogate's prediction of a sample, with bands if it is calibrated."""

    def answer(sample: Sample, cast: CastMould) -> Guess:
        if surrogate.calibration is not None:
            return surrogate.examine(cast, sample.parameters)
        (fields,) = surrogate.predict(cast, [sample.parameters])
        return np.asarray(fields)

    return answer


def field_errors(
    prediction: NDArray[np.floating], target: NDArray[np.floating], sample: Sample
) -> dict[str, float]:
    """Errors `ERRORS` of each field (8, y, x), over the image and the depression, and of density in tethers.

    sxsz and sysz are compared by magnitude.
    """
    ours, theirs = without_sign(prediction), without_sign(target)
    inside = sample.depression.astype(bool)
    # A mask turns each field into a single row of pixels.
    masked = vrmse(ours[:, inside][:, None], theirs[:, inside][:, None])
    errors: list[Sequence[float]] = [
        list(vrmse(ours, theirs)), list(masked), list(nrmse(ours, theirs)), field_pearson(ours, theirs)
    ]  # fmt: skip
    row = {
        f"{name}_{field}": float(value)
        for name, values in zip(ERRORS, errors, strict=True)
        for field, value in zip(FIELDS, values, strict=True)
    }
    return row | {"tether_error": _tether_error(ours, theirs, sample)}


def _tether_error(ours: NDArray[np.floating], theirs: NDArray[np.floating], sample: Sample) -> float:
    """Root mean square error of density (cells per pixel) over the pixels of tethers; NaN without any."""
    there = sample.tethers.astype(bool)
    if not there.any():
        return float("nan")
    return float(np.sqrt(((ours[0] - theirs[0])[there] ** 2).mean(dtype=np.float64)))


def evaluate(
    predict: Predictor,
    stack: Path,
    moulds: Mapping[str, Mould],
    on_progress: Callable[[int], None] = lambda simulation: None,
) -> pd.DataFrame:
    """Errors and measures of every test sample of a stack, one row each.

    Columns: those that identify the sample; `vrmse_`, `masked_vrmse_`, `nrmse_` and `pearson_` of each field;
    `tether_error`; each of `MEASURES` and `posts_lost`, simulated and predicted; with bands, the share of
    pixels that each covers (`cover95_density`), whether it covers each of `MEASURED`, its half width
    (`area_ratio_band95`), `disagreement`, `distance`, the flag and `scores`.
    """
    rows, table = [], read_table(stack)
    for sample in read_samples(stack, table.rows("test")):
        cast = CastMould(moulds[sample.mould], table.layers, table.pixels)
        guess = predict(sample, cast)
        prediction = guess.values if isinstance(guess, Prediction) else guess
        row: dict[str, Any] = {"simulation": sample.simulation, "mould": sample.mould}
        row |= asdict(sample.parameters) | {"n_cells": sample.n_cells, "converged": sample.converged}
        row |= field_errors(prediction, sample.fields, sample) | {"posts_lost_simulated": sample.posts_lost}
        row["vrmse_density_as_cast"] = float(vrmse(cast.density, sample.fields[0]))
        for source, fields in (("simulated", sample.fields), ("predicted", prediction)):
            measured = sample_measures(fields, cast)
            row |= {f"{name}_{source}": value for name, value in measured.items()}
        if isinstance(guess, Prediction):
            found = zip(MEASURED, guess.measures.tolist(), strict=True)
            row |= {f"{name}_predicted": value for name, value in found}
            row["posts_lost_predicted"] = guess.posts_lost
            row |= _coverage(guess, sample, row) | scores(guess, sample)
        rows.append(row)
        on_progress(sample.simulation)
    return pd.DataFrame(rows)


def _coverage(guess: Prediction, sample: Sample, row: Mapping[str, Any]) -> dict[str, Any]:
    """Coverage of the bands, and the flag."""
    inside = sample.depression.astype(bool)
    held = guess.field_bands.hold(without_sign(guess.values) - without_sign(sample.fields))
    true = np.array([row[f"{name}_simulated"] for name in MEASURED])
    covered = guess.measure_bands.hold(guess.measures - true)
    found: dict[str, Any] = {}
    for number, level in enumerate(LEVELS):
        name = f"cover{round(100 * level)}"
        found |= {f"{name}_{f}": float(held[number, i][inside].mean()) for i, f in enumerate(FIELDS)}
        for column, measure in enumerate(MEASURED):
            known = np.isfinite(true[column])
            found[f"{name}_{measure}"] = float(covered[number, column]) if known else float("nan")
    widest = guess.measure_bands.half[-1].tolist()
    found |= {f"{name}_band95": half for name, half in zip(MEASURED, widest, strict=True)}
    return found | {
        "disagreement": guess.disagreement,
        "distance": guess.distance,
        "out_of_distribution": guess.out_of_distribution,
    }


def noise_floor(stack: Path, repeats: Path, moulds: Mapping[str, Mould]) -> pd.DataFrame:
    """Seed-to-seed noise of each repeated tissue, one row each, with the columns of `evaluate`.

    Every pair of runs is compared as a prediction with its target; errors over sqrt 2 are those of the best
    possible prediction, the mean of many runs. Of measures, the standard deviation. A tissue whose own run
    failed is left out.

    Raises
    ------
    RaptorError
        If no run of the stack was repeated.
    """
    table, again = read_table(stack), read_table(repeats)
    runs, repeated = (list(zip(each.mould, each.parameters, strict=True)) for each in (table, again))
    rows = []
    for mould, parameters in dict.fromkeys(repeated):
        first, others = (
            [number for number, tissue in enumerate(tissues) if tissue == (mould, parameters)]
            for tissues in (runs, repeated)
        )
        if not first:
            continue
        samples = [*read_samples(stack, first), *read_samples(repeats, others)]
        pairs = [field_errors(a.fields, b.fields, b) for a, b in combinations(samples, 2)]
        row: dict[str, Any] = {"simulation": samples[0].simulation, "mould": mould, "runs": len(samples)}
        row |= asdict(samples[0].parameters)
        errors = pd.DataFrame(pairs).drop(columns=[f"pearson_{field}" for field in FIELDS]).mean()
        row |= {str(name): float(value) / np.sqrt(2) for name, value in errors.items()}
        cast = CastMould(moulds[mould], table.layers, table.pixels)
        measured = pd.DataFrame([sample_measures(s.fields, cast) for s in samples])
        row |= {name: float(measured[name].std(ddof=1)) for name in MEASURES}
        rows.append(row)
    if not rows:
        raise RaptorError(f"{repeats}: it repeats no run of {stack}; raise the repeats' runs")
    return pd.DataFrame(rows)


def in_floors(metrics: pd.DataFrame, floor: pd.DataFrame) -> dict[str, float]:
    """Mean errors of a model over the mean noise of the same moulds: 1 is the best possible.

    Fields by VRMSE; measures by root mean square error over root mean variance.
    """
    ours = metrics.set_index("simulation").loc[floor["simulation"]]
    found = {field: float(ours[f"vrmse_{field}"].mean() / floor[f"vrmse_{field}"].mean()) for field in FIELDS}
    found["tether_error"] = float(ours["tether_error"].mean() / floor["tether_error"].mean())
    for name in MEASURES[1:]:  # mean P is the same in every simulation of a mould
        error = (ours[f"{name}_predicted"] - ours[f"{name}_simulated"]).to_numpy()
        noise = float(np.sqrt(np.nanmean(floor[name] ** 2)))
        found[name] = float(np.sqrt(np.nanmean(error**2))) / noise if noise > 0 else float("nan")
    return found


def summarise(metrics: pd.DataFrame, floor: pd.DataFrame | None = None) -> dict[str, Any]:
    """Means over a set of samples: fields, bulk measures, bands, and errors over the noise floor."""
    fields = {
        field: {name: float(metrics[f"{name}_{field}"].mean()) for name in ERRORS}
        | {f"median_{name}": float(metrics[f"{name}_{field}"].median()) for name in ERRORS}
        for field in FIELDS
    }
    covers = [column for column in metrics if str(column).startswith("cover")]
    flagged = metrics.get("out_of_distribution")
    return {
        "samples": len(metrics),
        "not_converged": int((~metrics["converged"].astype(bool)).sum()),
        "losing_posts": int((metrics["posts_lost_simulated"] > 0).sum()),
        "fields": fields,
        "density_vrmse_as_cast": float(metrics["vrmse_density_as_cast"].mean()),
        "tether_error": float(metrics["tether_error"].mean()),
        "bulk": {name: agreement(metrics, name) for name in MEASURES},
        "coverage": {column: float(metrics[column].mean()) for column in covers},
        "out_of_distribution": None if flagged is None else float(flagged.mean()),
        "scores": {} if flagged is None else summary_of(metrics),
        "floor": None if floor is None else float(floor["vrmse_density"].mean()),
        "in_floors": {} if floor is None else in_floors(metrics, floor),
    }


def by_region(metrics: pd.DataFrame) -> pd.DataFrame:
    """Errors in each of `REGIONS`, one row each; A/A0 and w/w0 by mean absolute error."""
    rows = []
    for name, belongs in REGIONS.items():
        part = metrics[belongs(metrics)]
        row: dict[str, Any] = {"region": name, "samples": len(part)}
        if len(part):
            row |= {
                f"vrmse_{field}": part[f"vrmse_{field}"].mean() for field in ("density", "tension", "sxsx")
            }
            row |= {f"{shape}_mae": agreement(part, shape)["mae"] for shape in SHAPES}
            row |= {f"{shape}_bias": agreement(part, shape)["bias"] for shape in SHAPES}
            if "out_of_distribution" in part:
                row["out_of_distribution"] = part["out_of_distribution"].mean()
        rows.append(row)
    return pd.DataFrame(rows)


def regions_of(tables: Mapping[str, pd.DataFrame], trained: Collection[str]) -> pd.DataFrame:
    """Errors of a model by region on each campaign that it was trained on; on each other one as a whole.

    Regions of the first campaign have plain names, those of others begin with the campaign's.
    """
    parts = []
    for number, (name, table) in enumerate(tables.items()):
        part = by_region(table) if number == 0 or name in trained else by_region(table).head(1)
        parts.append(part.assign(region=f"{name}: " + part["region"]) if number else part)
    return pd.concat(parts, ignore_index=True)


def agreement(metrics: pd.DataFrame, name: str) -> dict[str, float]:
    """Predicted against simulated, without cases that lack the measure (no material there)."""
    pair = metrics[[f"{name}_simulated", f"{name}_predicted"]].dropna().to_numpy()
    if len(pair) < 2:
        nothing = dict.fromkeys(("pearson", "slope", "rmse", "mae", "bias"), float("nan"))
        return {"samples": len(pair)} | nothing
    simulated, predicted = pair.T
    spread = float(((simulated - simulated.mean()) ** 2).sum())
    covariance = float(((simulated - simulated.mean()) * (predicted - predicted.mean())).sum())
    return {
        "samples": len(pair),
        "pearson": pearson(simulated, predicted),
        "slope": covariance / spread if spread > 0 else float("nan"),
        "rmse": float(np.sqrt(((predicted - simulated) ** 2).mean())),
        "mae": float(np.abs(predicted - simulated).mean()),
        "bias": float((predicted - simulated).mean()),
    }


def compare(summaries: Mapping[str, Mapping[str, Any]], costs: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """One row per model: its cost, and its errors, absolute and over the noise floor."""
    rows = []
    for cost in costs:
        summary = summaries[cost["model"]]
        floors, bulk = summary["in_floors"], summary["bulk"]
        row = dict(cost) | {f"vrmse_{f}": summary["fields"][f]["vrmse"] for f in FIELDS}
        row |= {f"pearson_{name}": bulk[name]["pearson"] for name in MEASURES}
        row |= {f"{shape}_mae": bulk[shape]["mae"] for shape in SHAPES}
        row |= {f"{name}_in_floors": floors.get(name, np.nan) for name in (*FIELDS, "tether_error", *SHAPES)}
        rows.append(row)
    return pd.DataFrame(rows)


def by_campaign(
    summaries: Mapping[str, Mapping[str, Any]], trained: Mapping[str, Mapping[str, Any]]
) -> pd.DataFrame:
    """Errors of each trained model on the test split of each campaign, with the data it was trained on.

    `floor` is the noise floor of the VRMSE of density. `trained` is the training of each model, as model.json
    has it.
    """
    return pd.DataFrame(
        {
            "model": name,
            "trained_on": ", ".join(training["runs"]),
            "training_runs": sum(training["runs"].values()),
            "from_random_weights": training["initial_weights"] is None,
            "tested_on": campaign,
            "samples": summary["samples"],
            "vrmse_density": summary["fields"]["density"]["vrmse"],
            "floor": summary["floor"],
            **{f"{shape}_mae": summary["bulk"][shape]["mae"] for shape in SHAPES},
            "cover95_area_ratio": summary["coverage"]["cover95_area_ratio"],
            "out_of_distribution": summary["out_of_distribution"],
        }
        for name, training in trained.items()
        for campaign, summary in summaries[name].items()
    )
