"""Figures of campaigns: which moulds they cover, and what becomes of their tissues."""

from collections.abc import Mapping
from typing import Any, cast

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from raptor.plotting.drawing import PREDICTED, SEQUENTIAL, SIMULATED, STYLED, new_figure
from raptor.plotting.evaluation import COLOURS
from raptor.surrogate.out_of_distribution import MOULD_DESCRIPTORS

DESCRIPTOR_LABELS = {
    "area": r"$\sqrt{\mathrm{area}}$ ($l_0$)",
    "length": r"length ($l_0$)",
    "slenderness": "slenderness (log)",
    "tethers": r"$\sqrt{\mathrm{tethers}}$",
    "tether_area": r"$\sqrt{\mathrm{tether\ area}}$ ($l_0$)",
    "longest_tether": r"longest tether ($l_0$)",
}


@STYLED
def descriptors_figure(drawn: Mapping[str, pd.DataFrame], known: pd.DataFrame) -> Figure:
    """Descriptors of the moulds of campaigns as histograms, and those of known moulds, one row each.

    Shaded: the range of all campaigns. A known mould out of that range is a cross.

    Parameters
    ----------
    drawn : mapping
        Tables of `coverage.describe_moulds`, by campaign.
    known : DataFrame
        Table of `coverage.coverage`.
    """
    figure = new_figure(13.0, 2.6 + 0.19 * len(known))
    grid = cast(
        Any,
        figure.subplots(
            2, len(MOULD_DESCRIPTORS), sharex="col", sharey="row", height_ratios=[1.6, 0.19 * len(known)]
        ),
    )
    everything, places = pd.concat(list(drawn.values())), np.arange(len(known))
    for (top, bottom), name in zip(grid.T, MOULD_DESCRIPTORS, strict=True):
        low, high = everything[name].min(), everything[name].max()
        edges = np.linspace(low, high, 33)
        for (campaign, table), colour in zip(drawn.items(), COLOURS, strict=False):
            share = np.full(len(table), 1 / len(table))
            top.hist(table[name], edges, weights=share, histtype="step", color=colour, label=campaign)
        bottom.axvspan(low, high, color="#e8ecf4", lw=0)
        inside = known[name].between(low, high)
        bottom.plot(known[name][inside], places[inside], "o", ms=3, color=SIMULATED)
        bottom.plot(known[name][~inside], places[~inside], "x", ms=5, color=PREDICTED)
        bottom.set(xlabel=DESCRIPTOR_LABELS[name])
        bottom.grid(axis="y", lw=0.3, color="#dddddd")
    grid[0, 0].set(ylabel="share of moulds")
    grid[0, 0].legend(frameon=False, fontsize=7)
    grid[1, 0].set_yticks(places, known["mould"], fontsize=7)
    grid[1, 0].invert_yaxis()
    return figure


@STYLED
def outcomes_figure(table: pd.DataFrame) -> Figure:
    """Share of tissues that lost a tether, and median A/A0, by group of moulds and Delta.

    `table` is that of `outcomes.outcomes`. Numbers: simulations in each square.
    """
    groups = sorted(set(table["group"]))
    figure = new_figure(11.0, 1.7 + 0.3 * len(groups))
    most = max(0.1, float(table["losing_posts"].max()))
    shown = {
        "losing_posts": ("share of tissues that lost a tether", SEQUENTIAL, (0.0, most), "with_tethers"),
        "area_ratio": ("median $A/A_0$", f"{SEQUENTIAL}_r", (None, None), "simulations"),
    }
    panels = figure.subplots(1, len(shown), sharey=True)
    for axes, (column, (label, colours, limits, count)) in zip(panels, shown.items(), strict=True):
        values = table.pivot_table(index="group", columns="delta_from", values=column, dropna=False)
        image = axes.imshow(
            values.reindex(groups), cmap=colours, vmin=limits[0], vmax=limits[1], aspect="auto"
        )
        figure.colorbar(image, ax=axes, label=label)
        columns = list(values.columns)
        for group, start, number in zip(table["group"], table["delta_from"], table[count], strict=True):
            place = columns.index(start), groups.index(group)
            axes.text(*place, f"{number}", ha="center", va="center", fontsize=6, color="white")
        ends = table.groupby("delta_from")["delta_to"].first()
        axes.set_xticks(range(len(ends)), [f"{a:g}\N{EN DASH}{b:g}" for a, b in ends.items()], rotation=60)
        axes.set(xlabel=r"$\Delta$")
    panels[0].set_yticks(range(len(groups)), [g.replace("_", " ") for g in groups], fontsize=7)
    return figure
