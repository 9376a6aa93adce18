"""Figures of the errors of surrogates."""

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from raptor.moulds.geometry import Mould
from raptor.plotting.drawing import (
    LABELS,
    PREDICTED,
    SEQUENTIAL,
    SIMULATED,
    STYLED,
    THIRD,
    draw_mould,
    new_figure,
    show_field,
)
from raptor.studies.scores import CHANCES
from raptor.symmetry import FIELDS

SHAPE_LABELS = {"area_ratio": "$A/A_0$", "width_ratio": "$w/w_0$"}
COLOURS = (
    "#33508a", "#d98c21", "#3c8a5a", "#8a3355", "#6b6b6b", "#5aa9c9", "#b8860b", "#c39bd3", "#000000",
)  # fmt: skip


@STYLED
def training_figure(history: pd.DataFrame, means_until: int | None = None) -> Figure:
    """Loss and validation error by epoch, one line per network; the kept weights are marked.

    Parameters
    ----------
    means_until : int or None
        Epoch from which the networks sample, None if they do not. Both are then scores of samples, in panels
        of their own.
    """
    means = history["epoch"] < (np.inf if means_until is None else means_until)
    stages = [
        ("distance to the target", "VRMSE", history[means]),
        ("score of samples", "CRPS over std", history[~means]),
    ]
    stages = [stage for stage in stages if len(stage[-1])]
    figure = new_figure(4.5 * (1 + len(stages)), 3.0)
    for panels, (loss, error, table) in zip(
        cast(Any, figure.subplots(1, 2 * len(stages))).reshape(-1, 2), stages, strict=True
    ):
        _draw_stage(panels, table)
        panels[0].set(xlabel="epoch", ylabel=f"training loss: {loss}", yscale="log")
        panels[1].set(xlabel="epoch", ylabel=f"validation error (mean {error})", ylim=(0, None))
    return figure


def _draw_stage(panels: Sequence[Axes], history: pd.DataFrame) -> None:
    """Loss (dotted: a discriminator's) and validation error of each network in one stage of training."""
    kept = []
    for member, table in history.groupby("member"):
        colour = COLOURS[int(str(member)) % 7]
        panels[0].plot(table["epoch"], table["reconstruction_loss"], color=colour, label=f"member {member}")
        if table["discriminator_loss"].any():
            panels[0].plot(table["epoch"], table["discriminator_loss"], ":", color=colour)
        panels[1].plot(table["epoch"], table["validation_error"], color=colour)
        best = table.iloc[int(table["validation_error"].argmin())]
        panels[1].plot(best["epoch"], best["validation_error"], "o", color=colour)
        kept.append(float(best["validation_error"]))
    panels[0].legend(frameon=False, fontsize=7)
    panels[1].set_title("least: " + ", ".join(f"{value:.3f}" for value in kept))


@STYLED
def calibration_figure(metrics: pd.DataFrame, summary: Mapping[str, Any]) -> Figure:
    """Coverage of bands, error against band of both ratios, spread against error, chances of tethers."""
    figure = new_figure(11.0, 7.2)
    panels = figure.subplots(2, 3).ravel()
    _draw_coverage(panels[0], summary["coverage"])
    for axes, (name, label) in zip(panels[1:], SHAPE_LABELS.items(), strict=False):
        error = (metrics[f"{name}_predicted"] - metrics[f"{name}_simulated"]).abs()
        _draw_errors(axes, metrics[f"{name}_band95"], error, metrics["out_of_distribution"].astype(bool))
        axes.set(xlabel=f"half width of the 95 % band of {label}", ylabel=f"error of {label}")
    spread, skill = np.sqrt(metrics["spread"]), np.sqrt(metrics["skill"])
    _draw_errors(panels[3], spread, skill, metrics["out_of_distribution"].astype(bool))
    panels[3].set(
        xscale="log", yscale="log", xlabel="spread of samples of density", ylabel="error of their mean"
    )
    _draw_chances(panels[4], metrics)
    panels[5].set_axis_off()
    return figure


def _draw_coverage(axes: Axes, coverage: Mapping[str, float]) -> None:
    """Share that each band holds, of each field and ratio, beside what it promises."""
    names = [*FIELDS, *SHAPE_LABELS]
    labels = {name: text[text.index("$") :] for name, text in LABELS.items()} | SHAPE_LABELS
    levels = sorted({column.split("_")[0] for column in coverage})
    for level, colour in zip(levels, COLOURS, strict=False):
        found = [coverage[f"{level}_{name}"] for name in names]
        promised = int(level.removeprefix("cover")) / 100
        axes.axhline(promised, color=colour, lw=0.8, ls="--")
        axes.plot(range(len(names)), found, "o", color=colour, label=f"{100 * promised:.0f} % band")
    axes.set_xticks(range(len(names)), [labels[name] for name in names], rotation=60)
    axes.set(ylabel="share covered", ylim=(0, 1.02))
    axes.legend(frameon=False, fontsize=7, loc="lower left")


def _draw_errors(axes: Axes, expected: pd.Series, error: pd.Series, flagged: pd.Series) -> None:
    """Errors against what is expected of them, one point per simulation; dashed: both equal."""
    for part, colour, text in (
        (~flagged, SIMULATED, "like the training set"),
        (flagged, PREDICTED, "flagged"),
    ):
        style: dict[str, Any] = {"ms": 3, "mec": "none", "alpha": 0.6, "color": colour}
        axes.plot(expected[part], error[part], "o", **style, label=text)
    ends = [float(np.nanmin([error.min(), expected.min()])), float(np.nanmax([error.max(), expected.max()]))]
    axes.plot(ends, ends, "--", color=THIRD, lw=0.8)
    axes.legend(frameon=False, fontsize=7)


def _draw_chances(axes: Axes, metrics: pd.DataFrame) -> None:
    """How often tethers are held against the predicted chance, with their number, by class of the chance."""
    total = metrics[[name for name in metrics if "_at_" in str(name)]].sum()
    axes.plot([0, 1], [0, 1], "--", color=THIRD, lw=0.8)
    for lowest in CHANCES:
        ending = f"at_{100 * lowest:.0f}"
        number = total[f"seen_{ending}"]
        if number:
            place = total[f"chance_{ending}"] / number, total[f"seen_held_{ending}"] / number
            axes.plot(*place, "o", color=SIMULATED)
            axes.annotate(f"{number:.0f}", place, xytext=(5, -9), textcoords="offset points", fontsize=7)
    axes.set(xlabel="predicted chance that a tether is held", ylabel="share that is held")


@STYLED
def regions_figure(metrics: pd.DataFrame, regions: pd.DataFrame) -> Figure:
    """Errors over the parameters, and their means by region and campaign."""
    figure = new_figure(12.0, 4.0)
    where, fields, shapes = figure.subplots(1, 3, width_ratios=[1.3, 1, 1])
    order = metrics.sort_values("vrmse_density")
    shown = where.scatter(
        order["delta"], order["kappa_nnn"], c=order["vrmse_density"], s=14, cmap=SEQUENTIAL,
        vmax=float(order["vrmse_density"].quantile(0.98)), linewidths=0,
    )  # fmt: skip
    figure.colorbar(shown, ax=where, label="VRMSE of density")
    where.set(xlabel=r"$\Delta$", ylabel=r"$\kappa_{NNN}/\kappa_0$")
    table = regions[regions["samples"] > 0][::-1]
    rows = np.arange(len(table))
    fields.barh(rows, table["vrmse_density"], color=SIMULATED)
    fields.set_yticks(
        rows, [f"{name} ({n})" for name, n in zip(table["region"], table["samples"], strict=True)], fontsize=6
    )
    fields.set(xlabel="VRMSE of density")
    for offset, (name, colour) in enumerate(zip(SHAPE_LABELS, (SIMULATED, PREDICTED), strict=True)):
        shapes.barh(
            rows + 0.2 - 0.4 * offset, table[f"{name}_mae"], 0.38, color=colour, label=SHAPE_LABELS[name]
        )
    shapes.set_yticks([])
    shapes.set(xlabel="mean absolute error")
    shapes.legend(frameon=False, fontsize=7)
    return figure


@STYLED
def active_learning_figure(regions: pd.DataFrame) -> Figure:
    """Errors by region of models trained without and with further simulations, one bar per model."""
    figure = new_figure(12.0, 4.6)
    panels = figure.subplots(1, 3, sharey=True)
    models = list(dict.fromkeys(regions["model"]))
    names = list(dict.fromkeys(regions["region"]))
    height = 0.8 / len(models)
    measures = {"vrmse_density": "VRMSE of density"} | {
        f"{name}_mae": f"mean absolute error of {label}" for name, label in SHAPE_LABELS.items()
    }
    for axes, (column, label) in zip(panels, measures.items(), strict=True):
        for number, (model, colour) in enumerate(zip(models, COLOURS, strict=False)):
            table = regions[regions["model"] == model].set_index("region").reindex(names)
            places = np.arange(len(names)) - 0.4 + height * (number + 0.5)
            axes.barh(places, table[column], 0.95 * height, color=colour, label=model)
        axes.set(xlabel=label)
    panels[0].set_yticks(range(len(names)), names, fontsize=7)
    panels[0].invert_yaxis()
    panels[0].legend(frameon=False, fontsize=7)
    return figure


@STYLED
def worst_figure(
    cases: Sequence[tuple[str, Mould, NDArray[np.floating], NDArray[np.floating]]],
) -> Figure:
    """Densities of held-out cases, with titles: simulations above, prediction and samples below.

    Of each case (seeds, y, x), the held-out simulation first, then others with further seeds; and
    (1 + samples, y, x), the mean first, then samples if there are any.
    """
    across = 3
    figure = new_figure(14.0, 2.55 * -(-len(cases) // across))
    blocks = cast(Any, figure.subfigures(-(-len(cases) // across), across, squeeze=False))
    for block, (title, mould, simulated, predicted) in zip(blocks.ravel(), cases, strict=False):
        grid = block.subplots(2, max(len(simulated), len(predicted)), squeeze=False)
        limit = float(np.percentile(simulated[0], 99.8)) or 1.0
        rows = {"simulated": simulated, "predicted": predicted}
        for row, (name, images) in zip(grid, rows.items(), strict=True):
            row[0].set_ylabel(name, fontsize=7)
            for axes, density in zip(row, images, strict=False):
                show_field(axes, density, "density", limit)
                draw_mould(axes, mould, fill=False)
            for axes in row[len(images) :]:
                axes.set_axis_off()
        for number, axes in enumerate(grid[1, : len(predicted)]):
            axes.set_xlabel("sample" if number else "mean", fontsize=6)
        block.suptitle(title, fontsize=7)
    return figure


@STYLED
def models_figure(table: pd.DataFrame, histories: Mapping[str, pd.DataFrame]) -> Figure:
    """Validation error against training time, and errors against prediction time."""
    figure = new_figure(12.0, 3.8)
    training, cost, floors = figure.subplots(1, 3)
    colours = {name: COLOURS[number % len(COLOURS)] for number, name in enumerate(table["model"])}
    for name, history in histories.items():
        first = history[history["member"] == 0]
        training.plot(
            first["seconds"].cumsum() / 60, first["validation_error"], color=colours[name], label=name
        )
    training.set(
        xlabel="minutes of training, one network", ylabel="validation error (mean VRMSE)", yscale="log"
    )
    training.legend(frameon=False, fontsize=7)
    known = table.dropna(subset=["all_ms"]).sort_values("all_ms")
    # Names above and below by turns: two models may cost the same.
    for number, (_, row) in enumerate(known.iterrows()):
        cost.plot(row["all_ms"], row["vrmse_density"], "o", color=colours[row["model"]])
        cost.annotate(
            row["model"],
            (row["all_ms"], row["vrmse_density"]),
            xytext=(5, -9 if number % 2 else 4),
            textcoords="offset points",
            fontsize=7,
        )
    cost.set(
        xscale="log",
        xlabel="milliseconds per prediction, whole ensemble and all images",
        ylabel="VRMSE of density",
        ylim=(0, None),
    )
    cost.margins(x=0.25)
    quantities = {
        "density": "density",
        "tension": "tension",
        "sxsx": "$S_xS_x$",
        "area_ratio": "$A/A_0$",
        "width_ratio": "$w/w_0$",
    }
    width = 0.8 / max(len(table), 1)
    for number, (_, row) in enumerate(table.iterrows()):
        heights = [row[f"{name}_in_floors"] for name in quantities]
        floors.bar(
            np.arange(len(quantities)) + width * number - 0.4,
            heights,
            width,
            color=colours[row["model"]],
            label=row["model"],
        )
    floors.axhline(1.0, color=THIRD, ls="--", lw=0.8)
    floors.set_xticks(range(len(quantities)), list(quantities.values()))
    floors.set(ylabel="error / noise floor", yscale="log")
    floors.legend(frameon=False, fontsize=6, ncols=2)
    return figure


@STYLED
def learning_figure(table: pd.DataFrame) -> Figure:
    """Errors on the test split of each campaign against the number of training runs.

    One line for each set of campaigns trained on from random weights; one row of panels for each of these
    campaigns; dashed: the noise floor.
    """
    names = dict.fromkeys(table["tested_on"])
    table = table[table["from_random_weights"]].sort_values("training_runs")
    trained = list(dict.fromkeys(table["trained_on"]))
    tested = [name for name in names if name in ", ".join(trained).split(", ")]
    runs = sorted(set(table["training_runs"]))
    measures = {"vrmse_density": "VRMSE of density", "area_ratio_mae": "mean absolute error of $A/A_0$"}
    figure = new_figure(8.0, 0.6 + 2.8 * len(tested))
    grid = cast(Any, figure.subplots(len(tested), len(measures), squeeze=False, sharex=True))
    for row, campaign in zip(grid, tested, strict=True):
        for axes, (column, label) in zip(row, measures.items(), strict=True):
            for data, colour in zip(trained, COLOURS, strict=False):
                part = table[(table["trained_on"] == data) & (table["tested_on"] == campaign)]
                axes.plot(part["training_runs"], part[column], "o-", color=colour, label=data)
            axes.set(xscale="log", ylim=(0, 1.1 * table[column].max()), ylabel=label)
            axes.set_xticks(runs, [str(number) for number in runs], rotation=60)
            axes.minorticks_off()
            axes.set_title(f"tested on {campaign}")
        floor = table.loc[table["tested_on"] == campaign, "floor"].dropna()
        if len(floor):
            row[0].axhline(floor.iloc[0], color=THIRD, ls="--", lw=0.8, label="noise floor")
        row[0].legend(frameon=False, fontsize=7, title="trained on", title_fontsize=7)
    for axes in grid[-1]:
        axes.set(xlabel="training runs")
    return figure
