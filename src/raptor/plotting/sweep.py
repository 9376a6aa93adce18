"""Figures of sweeps: contraction curves, densities and directors over the parameters."""

from collections.abc import Mapping, Sequence
from typing import Any, cast

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from raptor.fields.directors import Directors, directors
from raptor.moulds.geometry import Mould
from raptor.plotting.drawing import STYLED, draw_mould, new_figure, show_field
from raptor.studies.sweep import Panel

LINES, MARKERS = ("-", "--", ":", "-."), ("o", "s", "^", "D")
MEASURE_LABELS = {
    "width": r"decrease of the central width, $100\,(1 - w/w_0)$ (%)",
    "area": r"decrease of the area, $100\,(1 - A/A_0)$ (%)",
}
RATIO = r"$\kappa_{NNNN}/\kappa_{NNN}$"
APART = 0.006  # in Delta, horizontal offset between points of the same Delta
RIM = 1.5  # l0 shown around a mould


def ordered_colours(values: Sequence[float]) -> dict[float, Any]:
    """A colour for each of several ascending values, from a perceptually uniform map."""
    colours = mpl.colormaps["viridis"](np.linspace(0.0, 0.82, len(values)))
    return dict(zip(values, map(tuple, colours), strict=True))


@STYLED
def contraction_figure(table: pd.DataFrame) -> Figure:
    """Contraction against Delta: simulations as points with error bars, predictions as lines with bands.

    `table` is that of `sweep.contraction`, of one or several moulds.
    """
    moulds = list(dict.fromkeys(table["mould"]))
    colours = ordered_colours(sorted(set(table["kappa_nnn"])))
    ratios = sorted(set(table["ratio"]))
    figure = new_figure(1.6 + 4.4 * len(moulds), 7.2)
    grid = cast(Any, figure.subplots(2, len(moulds), squeeze=False, sharex=True, sharey="row"))
    for column, mould in enumerate(moulds):
        for axes, measure in zip(grid[:, column], MEASURE_LABELS, strict=True):
            part = table[(table["mould"] == mould) & (table["measure"] == measure)]
            curves = part.groupby(["kappa_nnn", "ratio"])
            for number, ((kappa, ratio), curve) in enumerate(curves):
                style = ratios.index(ratio) % len(LINES)
                apart = APART * (number - (len(curves) - 1) / 2)
                _curve(axes, curve.sort_values("delta"), colours[kappa], style, apart)
            if column == 0:
                axes.set_ylabel(MEASURE_LABELS[measure])
        grid[0, column].set_title(str(mould).replace("_", " ").capitalize())
        grid[1, column].set_xlabel(r"cell-matrix interaction $\Delta$")
    _legend(figure, colours, ratios, predicted=bool(table["predicted"].notna().any()))
    return figure


def _curve(axes: Axes, curve: pd.DataFrame, colour: Any, style: int, apart: float) -> None:
    """One set of spring constants: simulated points, predicted line and band, clipped to 0 and 100 %."""
    delta, predicted, band = curve["delta"], curve["predicted"], curve["band95"]
    low, high = (predicted - band).clip(np.minimum(predicted, 0)), (predicted + band).clip(upper=100)
    axes.fill_between(delta, low, high, color=colour, alpha=0.12, lw=0)
    axes.plot(delta, predicted, LINES[style], color=colour, lw=1.4)
    axes.errorbar(
        delta + apart, curve["simulated"], curve["spread"].fillna(0.0), fmt=MARKERS[style], color=colour,
        ms=4, mfc="white", capsize=2, lw=1,
    )  # fmt: skip


def _legend(
    figure: Figure, colours: Mapping[float, Any], ratios: Sequence[float], *, predicted: bool
) -> None:
    """Colours of kappa_nnn, line styles of the ratio, and the meaning of points and lines."""
    handles = [
        Line2D([], [], color=colour, lw=3, label=rf"$\kappa_{{NNN}}/\kappa_0$ = {kappa:g}")
        for kappa, colour in colours.items()
    ]
    for number, ratio in enumerate(ratios):
        style = {"ls": LINES[number % 4], "marker": MARKERS[number % 4], "mfc": "white"}
        label = f"{RATIO} = {ratio:g}"
        handles.append(Line2D([], [], color="black", ms=4, label=label, **cast(Any, style)))
    point: Any = {"ls": "", "marker": "o", "mfc": "white", "color": "black", "ms": 4}
    handles.append(Line2D([], [], label="simulated (bar: deviation over seeds)", **point))
    if predicted:
        handles.append(Line2D([], [], color="black", label="predicted (shade: 95 % band)"))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=8)


@STYLED
def panels_figure(panels: Sequence[Panel], mould: Mould) -> Figure:
    """The paper's density panels: simulated above predicted, one block per Delta, on one scale."""
    deltas, kappas, ratios = (sorted({p.point[axis] for p in panels}) for axis in range(3))
    sources = list(panels[0].sources)
    limit = max(float(np.percentile(p.sources["simulated"][0], 99.8)) for p in panels)
    x0, y0, x1, y1 = mould.outline.bounds
    shape = (y1 - y0 + 2 * RIM) / (x1 - x0 + 2 * RIM)
    widths = [2.2 * len(kappas) + 0.3] * len(deltas) + [0.9]
    rows = len(sources) * len(ratios)
    figure = new_figure(sum(widths), 0.8 + rows * (2.0 * shape + 0.15))
    shown: Any = None
    *blocks, margin = cast(Any, figure.subfigures(1, len(widths), width_ratios=widths))
    for delta, block in zip(deltas, blocks, strict=True):
        grid = block.subplots(rows, len(kappas), squeeze=False)
        block.suptitle(rf"$\Delta$ = {delta:g}")
        of_block = {panel.point[1:]: panel for panel in panels if panel.point[0] == delta}
        for row, column in np.ndindex(len(ratios), len(kappas)):
            stacked = grid[len(sources) * row : len(sources) * (row + 1), column]
            panel = of_block.get((kappas[column], ratios[row]))
            for axes, source in zip(stacked, sources, strict=True):
                density = None if panel is None else panel.sources[source][0]
                shown = _panel(axes, density, mould, limit) or shown
            if row == 0:
                stacked[0].set_title(rf"$\kappa_{{NNN}}$ = {kappas[column]:g}", fontsize=8)
            if column == 0:
                for axes, source in zip(stacked, sources, strict=True):
                    axes.set_ylabel(f"{RATIO} = {ratios[row]:g}\n{source}", fontsize=7)
    margin.colorbar(shown, cax=margin.add_axes((0.05, 0.25, 0.2, 0.5)), label="density per pixel")
    return figure


def _panel(axes: Axes, density: NDArray[np.floating] | None, mould: Mould, limit: float) -> Any:
    """A density (y, x) in its mould; an empty frame if there is none."""
    image = None if density is None else show_field(axes, density, "density", limit)
    draw_mould(axes, mould, fill=False)
    x0, y0, x1, y1 = mould.outline.bounds
    axes.set(xlim=(x0 - RIM, x1 + RIM), ylim=(y0 - RIM, y1 + RIM))
    return image


@STYLED
def directors_figure(rows: Sequence[tuple[Panel, Mould]], thresholds: Mapping[str, float]) -> Figure:
    """Directors over density, one row per tissue: simulated left, predicted right; length by anisotropy.

    Directors are drawn where density is above the threshold of their source.
    """
    sources = list(rows[0][0].sources)
    figure = new_figure(5.25 * len(sources), 0.5 + 2.9 * len(rows))
    grid = cast(Any, figure.subplots(len(rows), len(sources), squeeze=False))
    limit = max(float(np.percentile(panel.sources["simulated"][0], 99.8)) for panel, _ in rows)
    for row, (panel, mould) in zip(grid, rows, strict=True):
        for axes, (source, fields) in zip(row, panel.sources.items(), strict=True):
            shown = _panel(axes, fields[0], mould, limit)
            found = directors(fields, thresholds[source])
            draw_directors(axes, found)
            axes.set_title(f"{source}, mean anisotropy {np.nanmean(found.anisotropy):.2f}", fontsize=8)
        delta, kappa, ratio = panel.point
        values = rf"$\Delta$ = {delta:g}, $\kappa_{{NNN}}$ = {kappa:g}, {RATIO} = {ratio:g}"
        row[0].set_ylabel(f"{mould.name.replace('_', ' ').capitalize()}\n{values}", fontsize=7)
    figure.colorbar(shown, ax=grid, shrink=0.5, label="density per pixel")
    return figure


def draw_directors(axes: Axes, found: Directors) -> None:
    """Each director as a line, as long as its square is wide if anisotropy is 1."""
    x, y = np.meshgrid(found.centres, found.centres)
    tissue = np.isfinite(found.anisotropy)
    x, y, angle = x[tissue], y[tissue], found.angle[tissue]
    length = found.anisotropy[tissue] * (found.centres[1] - found.centres[0])
    across, up = length * np.cos(angle), length * np.sin(angle)
    plain: Any = {"headwidth": 0, "headlength": 0, "headaxislength": 0, "pivot": "mid"}
    axes.quiver(
        x, y, across, up, angles="xy", scale_units="xy", scale=1, color="white", edgecolor="black",
        linewidth=0.35, width=0.0035, zorder=0.9, **plain,
    )  # fmt: skip
