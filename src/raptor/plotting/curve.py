"""Curves of a mould over one parameter: ratios and alignment, predicted with bands and simulated."""

from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from raptor.parameters import PARAMETERS
from raptor.plotting.drawing import PARAMETER_LABELS, PREDICTED, SIMULATED, STYLED, THIRD, new_figure

if TYPE_CHECKING:
    import pandas as pd

SHOWN = {"area_ratio": "$A/A_0$", "width_ratio": "$w/w_0$", "alignment": "alignment"}
COLOURS = (SIMULATED, PREDICTED, "#3c8a5a", "#8a3355", THIRD)


@STYLED
def curve_figure(table: "pd.DataFrame", mould: str) -> Figure:
    """A/A0, w/w0 and alignment over the first parameter that varies, one line per value of the others.

    Lines are predictions, with their 95 % bands; hollow where the surrogate calls the input unusual. Crosses
    are means of simulations, with their standard deviation.

    Parameters
    ----------
    table : DataFrame
        As `raptor.sweep` returns it.
    """
    varied = [name for name in PARAMETERS if table[name].nunique() > 1] or ["delta"]
    others = varied[1:]
    figure = new_figure(9.0, 3.2)
    groups = list(table.groupby(others)) if others else [((), table)]
    for axes, (name, label) in zip(figure.subplots(1, len(SHOWN)), SHOWN.items(), strict=True):
        for number, (values, part) in enumerate(groups):
            text = ", ".join(
                f"{PARAMETER_LABELS[other]} = {value:.3g}"
                for other, value in zip(others, values, strict=True)
            )
            _line(axes, part, varied[0], name, COLOURS[number % len(COLOURS)], text)
        axes.set(xlabel=PARAMETER_LABELS[varied[0]], ylabel=label)
    if others:
        axes.legend(frameon=False, fontsize=7)
    figure.suptitle(mould.replace("_", " "), fontsize=9)
    return figure


def _line(axes: Axes, part: "pd.DataFrame", x: str, name: str, colour: str, label: str) -> None:
    """One prediction as a line with its band, and simulations as crosses."""
    unusual = part["unusual"] != ""
    axes.plot(part[x], part[name], "-", color=colour, lw=1, label=label)
    style: dict[str, Any] = {"marker": "o", "ls": "none", "color": colour, "ms": 4}
    axes.plot(part[x][~unusual], part[name][~unusual], **style)
    axes.plot(part[x][unusual], part[name][unusual], **style, mfc="white")
    band = f"{name}_band95"
    if band in part:
        axes.fill_between(
            part[x], part[name] - part[band], part[name] + part[band], color=colour, alpha=0.15, lw=0
        )
    simulated = f"simulated_{name}"
    if simulated in part:
        spread = part.get(f"{simulated}_std")
        axes.errorbar(part[x], part[simulated], spread, fmt="x", color=colour, ms=5, capsize=2, lw=0.8)
