"""The model card: what a surrogate was trained on, how wrong it is, and where not to trust it."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import pandas as pd

from raptor.core.version import MODEL_VERSION, __version__
from raptor.dataset.netcdf import REFERENCES
from raptor.studies.evaluation import MEASURES, SHAPES
from raptor.surrogate.bands import LEVELS
from raptor.symmetry import FIELDS

if TYPE_CHECKING:  # tables and figures do not wait for torch
    from raptor.surrogate.inference import Surrogate

TEMPLATE = """# Model card: {name}

**What it is.** {members} networks ({network}, {weights:,} weights each, images of {seen} x {seen}
pixels) that predict, averaged over members and the eight images of D4, the eight fields of a
contracted tissue at {pixels} x {pixels} pixels from its mould (depression and tethers) and three
parameters (Delta, kappa_nnn, kappa_nnnn). {layers} cell layers. Predictions obey the physics:
density is not negative, not deeper than 5 sigma in a wall, and sums to the cells; the orientation
tensor is positive with density as its trace.

**Data.** The data set `{data}` (docs/card_paper.md): {test} simulations held out, none of whose
moulds was seen in training. Model version of the simulator {model_version}; RAPTOR {version}.

**Training.** {epochs} passes over the augmented training split{continued}.
Batches of {batch}, Adam at {rate}, {precision} layers, mean absolute error; {minutes:.0f} processor
minutes for all members. Weights are those of the epoch with the least validation error{stored}.

## Errors on the held-out simulations
VRMSE: root mean square error over the simulation's standard deviation. In floors: over the noise
from seed to seed of the simulator itself, where 1 is the best that any prediction can do.

| field | VRMSE | median | within the depression | Pearson | in floors |
| --- | --- | --- | --- | --- | --- |
{fields}

| measure | Pearson | slope | root mean square error | in floors |
| --- | --- | --- | --- | --- |
{measures}

Mean P is right by construction. A/A0 and w/w0: mean absolute errors {area:.4f} and {width:.4f}, tissue being
where predicted density is above {factor:.3f} times the simulator's threshold.

## Bands
Calibrated on the validation split; share of the held-out simulations that they hold:

| quantity | {levels} |
| --- | {rules} |
{bands}

## By region
| region | simulations | VRMSE of density | A/A0, mean absolute | w/w0, mean absolute | flagged as unlike |
| --- | --- | --- | --- | --- | --- |
{regions}

## Limits
Trust nothing outside of Delta {delta}, kappa_nnn {kappa_nnn}, kappa_nnnn {kappa_nnnn}, nor for
another number of layers. `raptor predict` flags moulds and parameters unlike the training set, and
predictions about which the networks disagree; a flag says nothing about what the simulator itself
leaves out. The signs of sxsz and sysz are spontaneous in simulations; predictions give magnitudes
with conventional signs.

Reference: {references}.
"""

EXTRA = {
    "random": "\nand further simulations drawn at random",
    "enriched": "\nand further simulations where its networks disagreed most",
}


def model_card(
    name: str,
    data: str,
    surrogate: "Surrogate",
    description: Mapping[str, Any],
    history: pd.DataFrame,
    summary: Mapping[str, Any],
    regions: pd.DataFrame,
    *,
    half: bool,
) -> str:
    """The card, in Markdown, of a surrogate with its training and its evaluation (`evaluation.summarise`)."""
    training, bulk, floors = description["training"], summary["bulk"], summary["in_floors"]
    covers = [f"cover{round(100 * level)}" for level in LEVELS]
    errors = summary["fields"]
    return TEMPLATE.format(
        name=name,
        data=data,
        members=len(surrogate.members),
        network=surrogate.architecture.network,
        weights=surrogate.weights,
        seen=surrogate.architecture.pixels,
        pixels=surrogate.pixels,
        layers=surrogate.layers,
        test=summary["samples"],
        model_version=MODEL_VERSION,
        version=__version__,
        epochs=history["epoch"].max() + 1,
        continued=_continued(training),
        batch=training["batch_size"],
        rate=training["learning_rate"],
        precision=training["precision"],
        minutes=history["seconds"].sum() * training["threads"] / 60,
        stored=", stored in half precision" if half else "",
        fields=_rows(
            [
                f,
                *(f"{errors[f][key]:.3f}" for key in ("vrmse", "median_vrmse", "masked_vrmse", "pearson")),
                _maybe(floors.get(f)),
            ]
            for f in FIELDS
        ),
        measures=_rows(
            [
                m,
                f"{bulk[m]['pearson']:.4f}",
                f"{bulk[m]['slope']:.3f}",
                f"{bulk[m]['rmse']:.3g}",
                _maybe(floors.get(m)),
            ]
            for m in MEASURES
        ),
        factor=1.0 if surrogate.calibration is None else surrogate.calibration.threshold_factor,
        area=bulk["area_ratio"]["mae"],
        width=bulk["width_ratio"]["mae"],
        levels=" | ".join(f"{100 * level:.0f} %" for level in LEVELS),
        rules=" | ".join("---" for _ in LEVELS),
        bands=_rows(
            [q, *(f"{100 * summary['coverage'][f'{c}_{q}']:.1f} %" for c in covers)]
            for q in (*FIELDS, *SHAPES)
        ),
        regions=_rows(
            [
                row["region"],
                int(row["samples"]),
                *(_maybe(row[key], 3) for key in ("vrmse_density", "area_ratio_mae", "width_ratio_mae")),
                _maybe(row.get("unlike"), 2),
            ]
            for row in regions.to_dict("records")
        ),
        delta="0.05 to 0.95",
        kappa_nnn="0.1 to 0.71",
        kappa_nnnn="0.01 to 0.5 and kappa_nnn/sqrt(2)",
        references=REFERENCES,
    )


def _continued(training: Mapping[str, Any]) -> str:
    """On what else, and from what, a training went on, in words."""
    further = "".join(EXTRA.get(campaign, "") for campaign in training["campaigns"])
    begun = training["initial_weights"]
    return (
        further
        if begun is None
        else f"{further}, the last {training['epochs']} from the weights of `{begun}`"
    )


def _maybe(value: float | None, digits: int = 2) -> str:
    """A number, or a dash where it was not measured."""
    return "-" if value is None or pd.isna(value) else f"{value:.{digits}f}"


def _rows(rows: Iterable[Iterable[object]]) -> str:
    return "\n".join("| " + " | ".join(str(cell) for cell in row) + " |" for row in rows)
