"""How good a surrogate is on held-out simulations, beside baselines that it has to beat."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from raptor.condor.lattice import cast_sites
from raptor.dataset.examples import Example, transform_sample
from raptor.dataset.stack import Sample, read_samples, read_table
from raptor.fields import rasterise
from raptor.metrics import BULK, bulk_statistics, field_pearson, nrmse, pearson, vrmse
from raptor.morphology import area_ratio, density_threshold, width_ratio
from raptor.moulds.geometry import Mould
from raptor.moulds.raster import MouldImage
from raptor.surrogate.inference import Surrogate
from raptor.symmetry import FIELDS, Element

MEASURES = (*BULK, "area_ratio", "width_ratio")


def sample_measures(
    fields: NDArray[np.floating], sample: Sample, mould: Mould, layers: int
) -> dict[str, float]:
    """Bulk statistics, A/A0 and w/w0 of fields (8, y, x) on a sample's mould, keyed by `MEASURES`."""
    threshold = density_threshold(layers, fields.shape[-1])
    image = MouldImage(sample.depression.astype(bool), sample.tethers.astype(bool))
    return bulk_statistics(fields, sample.n_cells, threshold) | {
        "area_ratio": area_ratio(fields[0], image, threshold),
        "width_ratio": width_ratio(fields[0], mould, threshold),
    }


def training_mean(stack: Path, examples: list[Example]) -> NDArray[np.float64]:
    """Mean fields (8, y, x) of the augmented training examples: what a guess without inputs gives."""
    splits = read_table(stack).split
    chosen = [example for example in examples if splits[example.sample] == "train"]
    total = np.zeros(())
    for example in chosen:
        (sample,) = read_samples(stack, [example.sample])
        total = total + transform_sample(sample, Element.from_index(example.element)).fields
    return np.asarray(total / len(chosen), dtype=np.float64)


def cast_density(mould: Mould, layers: int, pixels: int) -> NDArray[np.float64]:
    """Density (y, x) before any contraction: what a guess of "nothing happens" gives."""
    sites = cast_sites(mould, layers)
    return np.asarray(rasterise(sites, np.ones_like(sites), np.zeros(len(sites)), pixels)[0])


def without_sign(fields: NDArray[np.floating]) -> NDArray[np.floating]:
    """Fields (..., 8, y, x) with sxsz and sysz by magnitude: their sign is spontaneous."""
    spontaneous = [FIELDS.index(field) for field in ("sxsz", "sysz")]
    fields = fields.copy()
    fields[..., spontaneous, :, :] = np.abs(fields[..., spontaneous, :, :])
    return fields


def evaluate(
    surrogate: Surrogate,
    stack: Path,
    moulds: dict[str, Mould],
    mean: NDArray[np.float64],
    done: Callable[[int], None] = lambda row: None,
) -> pd.DataFrame:
    """Errors and measures of every test sample, one row each.

    Columns: what identifies the sample; `vrmse_`, `nrmse_` and `pearson_` of each field;
    `density_vrmse_` of the baselines; each of `MEASURES` as simulated and as predicted. sxsz and
    sysz are compared by magnitude.
    """
    rows = []
    layers = surrogate.layers
    for sample in read_samples(stack, read_table(stack).rows("test")):
        mould = moulds[sample.mould]
        masks = (sample.depression.astype(bool), sample.tethers.astype(bool))
        prediction = surrogate.predict(*masks, [sample.parameters], sample.n_cells)[0]
        scored = (without_sign(prediction), without_sign(sample.fields))
        row: dict[str, Any] = {"simulation": sample.simulation, "mould": sample.mould}
        row |= asdict(sample.parameters) | {"n_cells": sample.n_cells, "converged": sample.converged}
        for name, errors in (
            ("vrmse", vrmse(*scored)),
            ("nrmse", nrmse(*scored)),
            ("pearson", field_pearson(*scored)),
        ):
            row |= {f"{name}_{field}": float(e) for field, e in zip(FIELDS, errors, strict=True)}
        cast = cast_density(mould, layers, prediction.shape[-1])
        row["density_vrmse_training_mean"] = float(vrmse(mean[0], sample.fields[0]))
        row["density_vrmse_as_cast"] = float(vrmse(cast, sample.fields[0]))
        for source, fields in (("simulated", sample.fields), ("predicted", prediction)):
            measured = sample_measures(fields, sample, mould, layers)
            row |= {f"{name}_{source}": value for name, value in measured.items()}
        rows.append(row)
        done(sample.simulation)
    return pd.DataFrame(rows)


def summarise(metrics: pd.DataFrame) -> dict[str, Any]:
    """Means over the test set, and correlation, slope and error of each bulk measure."""
    errors = ("vrmse", "nrmse", "pearson")
    fields = {
        field: {name: float(metrics[f"{name}_{field}"].mean()) for name in errors}
        | {f"median_{name}": float(metrics[f"{name}_{field}"].median()) for name in errors}
        for field in FIELDS
    }
    return {
        "samples": len(metrics),
        "not_converged": int((~metrics["converged"].astype(bool)).sum()),
        "fields": fields,
        "density_vrmse": {
            "surrogate": fields["density"]["vrmse"],
            "training_mean": float(metrics["density_vrmse_training_mean"].mean()),
            "as_cast": float(metrics["density_vrmse_as_cast"].mean()),
        },
        "bulk": {name: _agreement(metrics, name) for name in MEASURES},
    }


def _agreement(metrics: pd.DataFrame, name: str) -> dict[str, float]:
    """Predicted against simulated; cases without the measure (no material there) are counted."""
    pair = metrics[[f"{name}_simulated", f"{name}_predicted"]].dropna().to_numpy()
    if len(pair) < 2:
        return {
            "samples": len(pair),
            "pearson": np.nan,
            "slope": np.nan,
            "rmse": np.nan,
            "mae": np.nan,
        }
    simulated, predicted = pair.T
    spread = float(((simulated - simulated.mean()) ** 2).sum())
    covariance = float(((simulated - simulated.mean()) * (predicted - predicted.mean())).sum())
    return {
        "samples": len(pair),
        "pearson": pearson(simulated, predicted),
        "slope": covariance / spread if spread > 0 else float("nan"),
        "rmse": float(np.sqrt(((predicted - simulated) ** 2).mean())),
        "mae": float(np.abs(predicted - simulated).mean()),
    }
