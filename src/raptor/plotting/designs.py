"""A search for moulds: its front, its progress, and the moulds that it found."""

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from raptor.plotting.drawing import PREDICTED, SIMULATED, STYLED, THIRD, draw_mould, new_figure

if TYPE_CHECKING:
    import pandas as pd

    from raptor.optimisation.designs import Designs

COLUMNS = 5


@STYLED
def front_figure(found: "Designs") -> Figure:
    """The front of a search as predicted and as simulated, and how it grew.

    Of one objective, each mould's value; of more, the first two.
    """
    figure = new_figure(9.0, 3.6)
    left, right = figure.subplots(1, 2, width_ratios=[1.4, 1])
    _front(left, found)
    for each, colour in zip(found.spec.objectives, (SIMULATED, PREDICTED, THIRD), strict=False):
        right.plot(found.progress["evaluations"], found.progress[each.label], color=colour, label=each.label)
    right.set(xlabel="moulds predicted", ylabel="best so far")
    right.legend(frameon=False, fontsize=7)
    return figure


def _front(axes: Axes, found: "Designs") -> None:
    names = [each.label for each in found.spec.objectives]
    x, table = names[0], found.table
    y = names[1] if len(names) > 1 else None
    if y is not None:
        axes.plot(found.front[x], found.front[y], ".", color="#cccccc", ms=4, label="front of the search")
    for group, marker in (("searched", "o"), ("compared", "s")):
        part = table[table["group"] == group]
        if part.empty:
            continue
        places = {by: _places(part, by, x, y) for by in ("predicted", "simulated") if f"{by}_{x}" in part}
        for by, colour in (("predicted", PREDICTED), ("simulated", SIMULATED)):
            if by in places:
                hollow: dict[str, Any] = {} if by == "simulated" else {"mfc": "none"}
                axes.plot(*places[by], marker, color=colour, ms=5, label=f"{group}, {by}", **hollow)
        if len(places) == 2:
            (x0, y0), (x1, y1) = places["predicted"], places["simulated"]
            axes.plot([x0, x1], [y0, y1], "-", color="#999999", lw=0.5, zorder=0)
        last = places.get("simulated", places["predicted"])
        for name, across, up in zip(part["design"], *last, strict=True):
            axes.annotate(str(name), (across, up), xytext=(4, 3), textcoords="offset points", fontsize=6)
    axes.set(xlabel=x.replace("_", " "), ylabel=(y or "").replace("_", " "))
    axes.legend(frameon=False, fontsize=7)


def _places(part: "pd.DataFrame", by: str, x: str, y: str | None) -> tuple[Any, Any]:
    """Coordinates of moulds in the plane of the objectives."""
    across = part[f"{by}_{x}"].to_numpy(dtype=float)
    return across, part[f"{by}_{y}"].to_numpy(dtype=float) if y else np.arange(len(across), dtype=float)


@STYLED
def designs_figure(found: "Designs") -> Figure:
    """The finalists and the moulds compared with, each with its objectives, simulated and predicted."""
    moulds, rows = found.moulds, -(-len(found.moulds) // COLUMNS)
    figure = new_figure(2.0 * COLUMNS, 2.55 * rows)
    grid = np.atleast_1d(figure.subplots(rows, COLUMNS)).ravel()
    for axes in grid:
        axes.axis("off")
    for axes, mould, (_, row) in zip(grid, moulds, found.table.iterrows(), strict=False):
        draw_mould(axes, mould)
        said = [str(row["design"]).replace("_", " ")]
        for each in found.spec.objectives:
            pair = [
                f"{row[f'{by}_{each.label}']:.3f}"
                for by in ("simulated", "predicted")
                if f"{by}_{each.label}" in row
            ]
            said.append(f"{each.label} {' / '.join(pair)}")
        axes.set_title("\n".join(said), fontsize=7)
    return figure
