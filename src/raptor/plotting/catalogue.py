"""Figures of a run, by name: each draws files of the run and returns the data shown."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from raptor.core.files import atomic_path, read_json
from raptor.dataset.netcdf import open_file
from raptor.dataset.result import load_fields
from raptor.dataset.shards import read_shard
from raptor.dataset.stack import record_fields
from raptor.fields.labelled import mould_of
from raptor.fields.metrics import BULK
from raptor.moulds import Mould, moulds_by_id
from raptor.plotting.campaigns import descriptors_figure, outcomes_figure
from raptor.plotting.drawing import bulk_figure, design_figure, fields_figure, save, tradeoff_figure
from raptor.plotting.evaluation import (
    active_learning_figure,
    calibration_figure,
    learning_figure,
    models_figure,
    regions_figure,
    training_figure,
    worst_figure,
)
from raptor.plotting.fits import fit_figure, valley_figure
from raptor.plotting.sweep import contraction_figure, directors_figure, panels_figure
from raptor.plotting.tissue import tissue_figure
from raptor.raster import density_threshold
from raptor.studies.coverage import coverage, describe_moulds, known_moulds
from raptor.studies.outcomes import outcomes
from raptor.studies.sweep import Panel, middle_points, read_panels
from raptor.symmetry import FIELDS

Drawn = tuple[Figure, pd.DataFrame | xr.Dataset]
Stacks = Mapping[str, NDArray[np.floating]]


def draw(kind: str, inputs: Mapping[str, Any], stem: Path, **options: Any) -> None:
    """Draw a figure of `FIGURES` from its files, as PNG, SVG and the data shown.

    Parameters
    ----------
    inputs
        Files by the names of the figure's parameters; CSV and JSON are read, others passed as paths.
    stem : Path
        Of the three files, without a suffix.
    """
    figure, data = FIGURES[kind](**{name: _read(value) for name, value in inputs.items()}, **options)
    save(figure, stem)
    if isinstance(data, xr.Dataset):
        with atomic_path(stem.with_name(f"{stem.name}.nc")) as path:
            data.to_netcdf(path, encoding={name: {"zlib": True, "complevel": 1} for name in data})
    else:
        with atomic_path(stem.with_name(f"{stem.name}.csv")) as path:
            data.to_csv(path, index=False)


def _read(given: Any) -> Any:
    """A table, the content of a JSON file, a path, or a list of these."""
    if not isinstance(given, str):
        return [_read(each) for each in given]
    path = Path(given)
    if path.suffix == ".csv":
        return pd.read_csv(path)
    return read_json(path) if path.suffix == ".json" else path


def _design(design: pd.DataFrame, moulds: Path) -> Drawn:
    by_id = moulds_by_id(moulds)
    shown = [by_id[name] for name in design["mould"]]
    design["area"] = [mould.depression.area for mould in shown]
    design["symmetry"] = [mould.symmetry for mould in shown]
    design["tethers"] = [len(mould.tethers) for mould in shown]
    return design_figure(design, list(by_id.values())), design


def _descriptors(moulds: Sequence[Path], mould_scale: float) -> Drawn:
    """Of the moulds of campaigns, named by their folders, and of the library."""
    drawn = {path.parent.name: describe_moulds(moulds_by_id(path).values()) for path in moulds}
    known = coverage(pd.concat(list(drawn.values())), describe_moulds(known_moulds(mould_scale)))
    return descriptors_figure(drawn, known), known


def _outcomes(simulated: pd.DataFrame, design: pd.DataFrame, moulds: Path) -> Drawn:
    tethers = pd.Series({name: len(mould.tethers) for name, mould in moulds_by_id(moulds).items()})
    table = outcomes(simulated, design, tethers)
    return outcomes_figure(table), table


def _bulk(metrics: pd.DataFrame, summary: Mapping[str, Any], campaign: str) -> Drawn:
    columns = [f"{name}_{source}" for name in BULK for source in ("simulated", "predicted")]
    return bulk_figure(metrics, summary[campaign]), metrics[["simulation", *columns]]


def _calibration(metrics: pd.DataFrame, summary: Mapping[str, Any], campaign: str) -> Drawn:
    coverage = pd.Series(summary[campaign]["coverage"], name="share").rename_axis("band")
    return calibration_figure(metrics, summary[campaign]), coverage.reset_index()


def _models(table: pd.DataFrame, histories: Sequence[pd.DataFrame], models: Mapping[str, int]) -> Drawn:
    """`models` gives the number of epochs after which each samples; scores of samples are not comparable."""
    found = zip(models.items(), histories, strict=True)
    means = {name: history[history["epoch"] < until] for (name, until), history in found}
    return models_figure(table, means), table


def _active_learning(regions: pd.DataFrame, models: Sequence[str]) -> Drawn:
    table = regions[regions["model"].isin(models) & (regions["samples"] > 0)]
    return active_learning_figure(table), table


def _valley(
    fit: Mapping[str, Any],
    posterior: Mapping[str, Any],
    points: pd.DataFrame,
    draws: pd.DataFrame,
    experimental_design: pd.DataFrame,
) -> Drawn:
    marks = {"surrogate's fit": fit["surrogate"]["parameters"], "paper's fit": fit["paper"]}
    known = {name: mark for name, mark in marks.items() if {"delta", "kappa_nnn"} <= mark.keys()}
    return valley_figure(points, draws, experimental_design, posterior, known), points


def _fields(samples: Path, moulds: Path) -> Drawn:
    """The first sample, that with the median error."""
    _, mould, stacks = next(iter(_samples(samples, moulds)))
    return fields_figure(stacks, mould), _dataset(stacks)


def _worst(samples: Path, moulds: Path) -> Drawn:
    _, *worst = _samples(samples, moulds)
    with open_file(samples) as file:
        simulated, predicted = (
            np.concatenate([file[first][1:, :1], file[others][1:]], axis=1).astype(np.float32)
            for first, others in (("simulated", "again"), ("predicted", "drawn"))
        )
    found = zip(worst, simulated, predicted, strict=True)
    cases = [(title, mould, seeds, draws) for (title, mould, _), seeds, draws in found]
    shown = xr.Dataset(
        {
            "simulated": (("case", "seed", "y", "x"), simulated),
            "predicted": (("case", "sample", "y", "x"), predicted),
        },
        coords={"case": [mould.name for _, mould, _ in worst]},
        attrs={"title": "Density per pixel; the first prediction is the mean", "Conventions": "CF-1.11"},
    )
    return worst_figure(cases), shown


def _samples(samples: Path, moulds: Path) -> list[tuple[str, Mould, Stacks]]:
    """Title, mould and fields (8, y, x) by source, of predicted samples."""
    by_id = moulds_by_id(moulds)
    found: list[tuple[str, Mould, Stacks]] = []
    with open_file(samples) as file:
        for row, mould in enumerate(file["mould"][:]):
            delta, *kappas = (float(file[name][row]) for name in ("delta", "kappa_nnn", "kappa_nnnn"))
            title = (
                f"{mould}: VRMSE {float(file['vrmse_density'][row]):.2f}\n$\\Delta$ {delta:.2f}, "
                f"$\\kappa$ {kappas[0]:.2f}, {kappas[1]:.2f}"
            )
            stacks = {"simulation": file["simulated"][row], "prediction": file["predicted"][row]}
            found.append((title, by_id[str(mould)], stacks))
    return found


def _panels(stack: Path, moulds: Path, predicted: Sequence[Path], mould: str) -> Drawn:
    panels, _ = read_panels(stack, mould, next(iter(predicted), None))
    return panels_figure(panels, moulds_by_id(moulds)[mould]), _panel_dataset(panels)


def _directors(stack: Path, moulds: Path, predicted: Sequence[Path]) -> Drawn:
    rows: list[tuple[Panel, Mould]] = []
    thresholds: dict[str, float] = {}
    for name, mould in moulds_by_id(moulds).items():
        panels, thresholds = read_panels(stack, name, next(iter(predicted), None))
        rows += [(panel, mould) for panel in middle_points(panels)]
    return directors_figure(rows, thresholds), _panel_dataset([panel for panel, _ in rows])


def _panel_dataset(panels: Sequence[Panel]) -> xr.Dataset:
    return _dataset(
        {
            "_".join([panel.mould, *(f"{value:g}" for value in panel.point), source]): fields
            for panel in panels
            for source, fields in panel.sources.items()
        }
    )


def _fit(
    fit: Mapping[str, Any],
    tissue: Path,
    prediction: Path,
    other_fit: Sequence[Any],
    other_tissue: Sequence[Path],
) -> Drawn:
    with xr.open_dataset(prediction) as file:
        predicted = np.stack([file[name].to_numpy() for name in FIELDS])
        mould, cast_threshold = mould_of(file), density_threshold(file.attrs["layers"], predicted.shape[-1])
        thresholds = {"prediction": float(file.attrs["threshold"]), "simulation": cast_threshold}
    stacks: dict[str, NDArray[np.floating]] = {"prediction": predicted}
    stacks["simulation"] = _simulated(tissue, predicted.shape[-1])
    rows = [
        {"source": "measured", **fit["target"]},
        {"source": "prediction", **fit["surrogate"]},
        {"source": "simulation", **fit["simulation"]},
    ]
    for content, path in zip(other_fit, other_tissue, strict=True):
        stacks["fit by simulator"] = _simulated(path, predicted.shape[-1])
        thresholds["fit by simulator"] = cast_threshold
        rows.append({"source": "fit by simulator", **content["simulation"]})
    densities = {name: stack[0] for name, stack in stacks.items()}
    return fit_figure(mould, densities, thresholds, rows), _dataset(stacks)


def _tissue(prediction: Path) -> Drawn:
    fields = load_fields(prediction)
    return tissue_figure(fields), fields


def _simulated(shard: Path, pixels: int) -> NDArray[np.float32]:
    """Fields (8, y, x) of the one simulation of a shard."""
    (record,) = read_shard(shard).records
    return record_fields(record, pixels)


def _dataset(stacks: Stacks) -> xr.Dataset:
    """Field stacks (8, y, x), by name."""
    return xr.Dataset(
        {
            name: (("field", "y", "x"), stack.astype(np.float32), {"long_name": name, "units": "1"})
            for name, stack in stacks.items()
        },
        coords={"field": list(FIELDS)},
        attrs={"title": "Fields of a figure, per pixel", "Conventions": "CF-1.11"},
    )


FIGURES: dict[str, Callable[..., Drawn]] = {
    "design": _design,
    "descriptors": _descriptors,
    "outcomes": _outcomes,
    "bulk": _bulk,
    "training": lambda history, means_until: (training_figure(history, means_until), history),
    "calibration": _calibration,
    "regions": lambda metrics, regions: (regions_figure(metrics, regions), regions),
    "models": _models,
    "learning": lambda table: (learning_figure(table), table),
    "active_learning": _active_learning,
    "tradeoff": lambda table: (tradeoff_figure(table), table),
    "contraction": lambda table: (contraction_figure(table), table),
    "valley": _valley,
    "fields": _fields,
    "worst": _worst,
    "panels": _panels,
    "directors": _directors,
    "fit": _fit,
    "tissue": _tissue,
}
"""The function that draws each figure from the content of its files."""
