"""Figures of fitted tissues."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import chi2

from raptor.moulds.geometry import Mould
from raptor.plotting.drawing import (
    HALF,
    PARAMETER_LABELS,
    PREDICTED,
    SEQUENTIAL,
    SIMULATED,
    STYLED,
    THIRD,
    draw_mould,
    new_figure,
    show_field,
)

COLOURS = (THIRD, PREDICTED, SIMULATED, "#3c8a5a", "#8a3355")
LIMIT = -chi2.ppf(0.95, 1) / 2  # log profile likelihood at the ends of the 95 % interval


@STYLED
def fit_figure(
    mould: Mould,
    densities: Mapping[str, NDArray[np.floating]],
    thresholds: Mapping[str, float],
    rows: Sequence[Mapping[str, Any]],
) -> Figure:
    """Densities (y, x) of a fitted tissue in its mould, with contours; ratios beside the target."""
    figure = new_figure(3.5 * (len(densities) + 1), 3.4)
    panels = figure.subplots(1, len(densities) + 1)
    limit = max(float(density.max()) for density in densities.values())
    for axes, (name, density) in zip(panels, densities.items(), strict=False):
        shown = show_field(axes, density, "density", limit)
        frame = (-HALF, HALF, -HALF, HALF)
        axes.contour(
            density, [thresholds[name]], origin="lower", extent=frame, colors="white", linewidths=0.8
        )
        draw_mould(axes, mould, fill=False)
        axes.set_title(name)
    figure.colorbar(shown, ax=panels[:-1], shrink=0.8, label="density per pixel")
    width = 0.8 / len(rows)
    for number, (row, colour) in enumerate(zip(rows, COLOURS, strict=False)):
        values = [row["area_ratio"], row["width_ratio"]]
        heights = [np.nan if value is None else value for value in values]
        places = np.arange(2) + width * (number - (len(rows) - 1) / 2)
        panels[-1].bar(places, heights, 0.92 * width, color=colour, label=row["source"])
    panels[-1].set_xticks([0, 1], ["$A/A_0$", "$w/w_0$"])
    panels[-1].set_ylim(0, 1.2 + 0.1 * len(rows))
    panels[-1].legend(frameon=False, loc="upper center", fontsize=7)
    return figure


@STYLED
def valley_figure(
    points: pd.DataFrame,
    draws: pd.DataFrame,
    experimental_design: pd.DataFrame,
    posterior: Mapping[str, Any],
    marks: Mapping[str, Mapping[str, float]],
) -> Figure:
    """What two ratios leave open: posterior draws, profile likelihoods, value of other measurements.

    Parameters
    ----------
    points : DataFrame
        Draws from the posterior, by parameter.
    draws : DataFrame
        Those that were simulated, with `area_ratio`.
    experimental_design : DataFrame
        From `fitting.rank_measurements`.
    posterior : mapping
        From `fitting.summarise`.
    marks : mapping
        Fits to mark, parameters by name.
    """
    figure = new_figure(13.0, 4.0)
    valley, profiles, bars = figure.subplots(1, 3, width_ratios=[1.2, 1, 1.1])
    _draw_valley(valley, points, draws, marks)
    if len(draws):
        figure.colorbar(valley.collections[-1], ax=valley, label="simulated $A/A_0$", shrink=0.8)
    _draw_profiles(profiles, posterior)
    _draw_experimental_design(bars, experimental_design)
    return figure


def _draw_valley(
    axes: Axes, points: pd.DataFrame, draws: pd.DataFrame, marks: Mapping[str, Mapping[str, float]]
) -> None:
    """Posterior draws over delta and kappa_nnn, with simulations and fits."""
    axes.plot(points["delta"], points["kappa_nnn"], ".", ms=3, color=THIRD, alpha=0.35, rasterized=True)
    for (name, mark), shape in zip(marks.items(), "s*D", strict=False):
        axes.plot(mark["delta"], mark["kappa_nnn"], shape, ms=9, mec="black", color=PREDICTED, label=name)
    if len(draws):
        axes.scatter(
            draws["delta"],
            draws["kappa_nnn"],
            c=draws["area_ratio"],
            s=45,
            cmap=SEQUENTIAL,
            edgecolors="black",
        )
    axes.set(xlim=(0.05, 0.95), ylim=(0.1, 0.71))
    axes.set(xlabel=PARAMETER_LABELS["delta"], ylabel=PARAMETER_LABELS["kappa_nnn"])
    axes.legend(frameon=False, fontsize=7)


def _draw_profiles(axes: Axes, posterior: Mapping[str, Any]) -> None:
    """Profile likelihoods of the parameters, each over its own range."""
    for (name, profile), colour in zip(posterior["profiles"].items(), COLOURS[::-1], strict=False):
        values = np.array(profile["value"])
        heights = np.array([np.nan if v is None else v for v in profile["log_likelihood"]], dtype=float)
        part = (values - values[0]) / (values[-1] - values[0])
        axes.plot(part, heights, "-", color=colour, label=PARAMETER_LABELS[name])
    axes.axhline(LIMIT, ls="--", lw=0.8, color=THIRD)
    axes.set(ylim=(-6, 0.3), xlabel="position in the parameter's range", ylabel="log profile likelihood")
    axes.set_title("" if posterior["reachable"] else "not reachable on this mould: intervals are meaningless")
    axes.legend(frameon=False, fontsize=8, loc="lower center")


def _draw_experimental_design(axes: Axes, ranked: pd.DataFrame) -> None:
    """Relative deviations of the parameters after each candidate measurement."""
    table = ranked[::-1]
    places = np.arange(len(table))
    axes.barh(places, table["left"], 0.8, color=SIMULATED)
    axes.barh(places, table["left_exact_model"], 0.35, color="#b9c6e3")
    axes.set_yticks(places, table["label"].tolist(), fontsize=8)
    axes.axvline(1.0, ls="--", lw=0.8, color=THIRD)
    axes.set(xlabel="relative deviation after one more measurement", xlim=(0, 1.1))
