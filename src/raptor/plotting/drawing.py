"""The style of figures; figures of moulds, fields, data sets and tissues."""

import re
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any, cast

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path
from raptor.fields.metrics import BULK
from raptor.frame import IMAGE_SIZE
from raptor.moulds.cast import cast_sites
from raptor.moulds.geometry import Mould
from raptor.symmetry import FIELDS

if TYPE_CHECKING:  # slow imports that only some figures need
    import pandas as pd

    from raptor.condor.simulate import Tissue

SEQUENTIAL, DIVERGING = "cividis", "PuOr"  # perceptually uniform; safe for the colour-blind
SIMULATED, PREDICTED, THIRD = "#33508a", "#d98c21", "#6b6b6b"
LABELS = {
    "density": "density $P$", "tension": "tension $T$", "sxsx": "$S_x S_x$", "sysy": "$S_y S_y$",
    "szsz": "$S_z S_z$", "sxsy": "$S_x S_y$", "sxsz": "$S_x S_z$", "sysz": "$S_y S_z$",
}  # fmt: skip
BULK_LABELS = {
    "P": "mean density $P$", "N": "pixels of tissue $N(P > P_c)$", "T": "mean $T$",
    "Tbar": r"mean $\bar{T}$", "SxSx": "mean $S_x S_x$", "SxSxbar": r"mean $\overline{S_x S_x}$",
    "SySy": "mean $S_y S_y$", "SySybar": r"mean $\overline{S_y S_y}$",
}  # fmt: skip
PARAMETER_LABELS = {
    "delta": r"$\Delta$",
    "kappa_nnn": r"$\kappa_{NNN}/\kappa_0$",
    "kappa_nnnn": r"$\kappa_{NNNN}/\kappa_0$",
}
STYLE: dict[Any, Any] = {
    "svg.hashsalt": "raptor", "svg.fonttype": "none", "font.size": 9, "axes.titlesize": 9,
    "axes.spines.top": False, "axes.spines.right": False, "figure.dpi": 120, "savefig.dpi": 150,
}  # fmt: skip
STYLED = mpl.rc_context(STYLE)
"""Decorator of a drawing function: draw in the style of this package."""
METADATA: dict[str, dict[str, None]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None},
    ".pdf": {"CreationDate": None},
}
"""Suffixes of pictures, and metadata omitted so that the same data give the same bytes."""
HALF = IMAGE_SIZE / 2
HALO = [withStroke(linewidth=1.5, foreground="#b5402f")]  # a number is read beside a thin tether too


class NotebookFigure(Figure):
    """A figure that a notebook displays without pyplot."""

    def _repr_png_(self) -> bytes:
        file = BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()


@STYLED
def new_figure(width: float, height: float) -> Figure:
    """An empty figure, size in inches."""
    return NotebookFigure(figsize=(width, height), layout="constrained")


def save(figure: Figure, stem: Path) -> None:
    """Write a figure as PNG and SVG, the same bytes for the same data."""
    for suffix in (".png", ".svg"):
        save_picture(figure, stem.with_name(stem.name + suffix))


def save_picture(figure: Figure, path: Path) -> None:
    """Write a figure as PNG, SVG or PDF, by its suffix, the same bytes for the same data.

    Raises
    ------
    RaptorError
        If the suffix is another, or the file cannot be written.
    """
    require_picture(path)
    with mpl.rc_context(STYLE), atomic_path(path) as temporary:
        figure.savefig(temporary, metadata=METADATA[path.suffix.lower()])


def require_picture(path: Path) -> None:
    """Raise a RaptorError unless a path has the suffix of a picture."""
    if path.suffix.lower() not in METADATA:
        raise RaptorError(f"{path} is not a picture's name; give one that ends in {' or '.join(METADATA)}")


def draw_mould(axes: Axes, mould: Mould, *, fill: bool = True) -> None:
    """Outline of a depression, and its tethers, in l0."""
    outline = np.asarray(mould.outline.exterior.coords)
    axes.add_patch(
        Polygon(
            outline,
            closed=True,
            facecolor="#e9e4d4" if fill else "none",
            edgecolor="#444444",
            lw=0.8,
        )
    )
    for tether in mould.tethers:
        corners = np.asarray(tether.polygon.exterior.coords)
        axes.add_patch(Polygon(corners, closed=True, facecolor="#b5402f", edgecolor="none"))
    axes.set(xlim=(-HALF, HALF), ylim=(-HALF, HALF), aspect="equal", xticks=[], yticks=[])


def show_field(axes: Axes, image: NDArray[np.floating], field: str, limit: float) -> Any:
    """One field (y, x); signed fields on a scale symmetric about zero."""
    signed = field in ("tension", "sxsy", "sxsz", "sysz")
    shown = axes.imshow(
        image,
        origin="lower",
        extent=(-HALF, HALF, -HALF, HALF),
        cmap=DIVERGING if signed else SEQUENTIAL,
        vmin=-limit if signed else 0.0,
        vmax=limit,
        interpolation="nearest",
    )
    axes.set(xticks=[], yticks=[])
    return shown


@STYLED
def fields_figure(stacks: Mapping[str, NDArray[np.floating]], mould: Mould) -> Figure:
    """The paper's first figure: a mould and its eight fields, from one or several stacks (8, y, x) by source.

    The colour scale of a field is that of the first stack.
    """
    count = len(stacks)
    figure = new_figure(11.0, 0.4 + 3.0 * count)
    left, right = cast(Any, figure.subfigures(1, 2, width_ratios=[1, 5.2]))
    axes = left.add_subplot()
    draw_mould(axes, mould)
    axes.spines[:].set_visible(False)
    axes.set_title(f"mould {mould.name}\n(image {IMAGE_SIZE:g} $l_0$ wide)")
    grid = right.subplots(2 * count, 4)
    for number, field in enumerate(FIELDS):
        row, column = count * (number // 4), number % 4
        limit = float(np.percentile(np.abs(next(iter(stacks.values()))[number]), 99.8)) or 1.0
        for offset, (source, stack) in enumerate(stacks.items()):
            shown = show_field(grid[row + offset, column], stack[number], field, limit)
            if column == 0:
                grid[row + offset, column].set_ylabel(source)
        grid[row, column].set_title(LABELS[field])
        right.colorbar(shown, ax=grid[row : row + count, column], shrink=0.8, format="%.2g")
    return figure


@STYLED
def mould_figure(mould: Mould, rows: Mapping[str, str], like: Mould | None = None) -> Figure:
    """A mould as the model sees it, with the cells of its lowest layer and the numbers of its tethers.

    Parameters
    ----------
    rows : mapping
        Content of the title, by name.
    like : Mould, optional
        Another mould, whose outline is drawn dashed.
    """
    figure = new_figure(5.2, 5.8)
    axes = figure.add_subplot()
    draw_mould(axes, mould)
    for number, tether in enumerate(mould.tethers, start=1):
        middle = tether.polygon.representative_point()
        style: dict[str, Any] = {"ha": "center", "va": "center", "color": "white", "fontsize": 7}
        axes.text(middle.x, middle.y, str(number), weight="bold", path_effects=HALO, **style)
    sites = cast_sites(mould, 1)
    axes.plot(sites[:, 0], sites[:, 1], ".", ms=1.5, color=SIMULATED, rasterized=True)
    if like is not None:
        for shape in (like.outline, *(tether.polygon for tether in like.tethers)):
            axes.plot(*np.asarray(shape.exterior.coords).T, "--", color=PREDICTED, lw=1)
    axes.plot([-HALF + 2, -HALF + 12], [-HALF + 2] * 2, "-", color="black", lw=2, solid_capstyle="butt")
    axes.text(-HALF + 7, -HALF + 2.8, "10 $l_0$", ha="center", va="bottom")
    axes.spines[:].set_visible(True)  # the frame is part of the model's input
    width = max(len(name) for name in rows)
    indent = "\n" + (width + 2) * " "
    table = [f"{name:>{width}}  {indent.join(wrap(value, 50))}" for name, value in rows.items()]
    axes.set_title("\n".join(table), loc="left", family="monospace", fontsize=8)
    return figure


@STYLED
def bulk_figure(metrics: "pd.DataFrame", summary: Mapping[str, Any]) -> Figure:
    """The paper's scatter: eight bulk statistics, predicted against simulated, and their r."""
    figure = new_figure(10.5, 5.6)
    for axes, name in zip(figure.subplots(2, 4).ravel(), BULK, strict=True):
        scatter(axes, metrics[f"{name}_simulated"], metrics[f"{name}_predicted"])
        axes.set_title(f"{BULK_LABELS[name]}\n$r$ = {summary['bulk'][name]['pearson']:.3f}")
    figure.supxlabel("CONDOR simulation")
    figure.supylabel("surrogate's prediction")
    return figure


def scatter(axes: Axes, simulated: "pd.Series", predicted: "pd.Series") -> None:
    """Predicted against simulated, with the line of perfect agreement."""
    low = float(min(simulated.min(), predicted.min()))
    high = float(max(simulated.max(), predicted.max()))
    pad = 0.05 * (high - low) or 1.0
    axes.plot([low - pad, high + pad], [low - pad, high + pad], "--", color=THIRD, lw=0.8)
    axes.plot(simulated, predicted, "o", color=SIMULATED, ms=4, alpha=0.75, mec="none")
    axes.set(xlim=(low - pad, high + pad), ylim=(low - pad, high + pad), box_aspect=1)
    axes.locator_params(nbins=4)


@STYLED
def design_figure(table: "pd.DataFrame", moulds: Sequence[Mould]) -> Figure:
    """Distributions of a design, and some of its moulds.

    Parameters
    ----------
    table : DataFrame
        The design, one row per simulation, with the mould's `area` (l0^2), `tethers` and `symmetry`.
    moulds : sequence of Mould
        Moulds to draw.
    """
    figure = new_figure(12.0, 4.8)
    top, bottom = cast(Any, figure.subfigures(2, 1, height_ratios=[1.8, 1]))
    panels = top.subplots(1, 5)
    edge = table["edge"].astype(bool) if "edge" in table else table["delta"] < 0
    panels[0].hist(
        [table["delta"][~edge], table["delta"][edge]], bins=18, range=(0.05, 0.95), stacked=True,
        color=[SIMULATED, PREDICTED], label=["drawn", "at an end"],
    )  # fmt: skip
    panels[0].set(xlabel=r"$\Delta$", ylabel="simulations")
    panels[0].legend(frameon=False, fontsize=7)
    dots = {"ms": 3, "alpha": min(1.0, 150 / len(table) + 0.15), "mew": 0, "rasterized": True}
    panels[1].plot(table["kappa_nnn"], table["kappa_nnnn"], "o", color=SIMULATED, **dots)
    panels[1].plot([0.1, 0.71], [0.1 / np.sqrt(2), 0.71 / np.sqrt(2)], "--", color=THIRD, lw=0.8)
    panels[1].set(xlabel=r"$\kappa_{NNN}/\kappa_0$", ylabel=r"$\kappa_{NNNN}/\kappa_0$")
    panels[2].hist(table["area"], bins=15, color=SIMULATED)
    panels[2].set(xlabel="area of the depression ($l_0^2$)")
    tethers, counts = np.unique(table["tethers"], return_counts=True)
    panels[3].bar(tethers, counts, color=SIMULATED)
    panels[3].set(xlabel="tethers per mould")
    names, counts = np.unique(table["symmetry"], return_counts=True)
    panels[4].barh([name.replace("_", " ") for name in names], counts, color=SIMULATED)
    panels[4].set(xlabel="moulds by symmetry class")
    for axes, mould in zip(bottom.subplots(1, 8), moulds, strict=False):
        draw_mould(axes, mould)
        axes.spines[:].set_visible(False)
    return figure


@STYLED
def tradeoff_figure(table: "pd.DataFrame") -> Figure:
    """Error of density and energy against cost: one small point per case, a large one for the median.

    Energies less than 0.1 % above the lowest are drawn at 0.1 %.
    """
    table = table.assign(method=table["method"].str.replace(r", seed \d+", "", regex=True))
    shown = table[~table["method"].str.contains(r"layers|shells|pixels|minimised")]
    figure = new_figure(9.0, 4.2)
    panels = figure.subplots(1, 2)
    axes_of = {"density_error": panels[0], "energy_above_best": panels[1]}
    for quantity, axes in axes_of.items():
        means = []
        for method, group in shown.groupby("method", sort=False):
            points = group[["core_seconds", quantity]].dropna().clip(lower=1e-3)
            if points.empty:
                continue
            colour = _method_colour(str(method))
            axes.plot(*points.to_numpy().T, ".", color=colour, alpha=0.35, ms=4)
            means.append((str(method), *points.median()))
        for method, x, y in means:
            axes.plot(x, y, "o", color=_method_colour(method), ms=8)
            below = method.endswith("float32")
            place = {"xytext": (-6, -6) if below else (6, 6), "ha": "right" if below else "left"}
            style = {"textcoords": "offset points", "va": "top" if below else "bottom", "fontsize": 7}
            axes.annotate(method, (x, y), **place, **style)
        anneals = sorted((x, y) for method, x, y in means if re.fullmatch(r"anneal-[\de]+", method))
        if anneals:
            axes.plot(*np.transpose(anneals), "-", color=_method_colour("anneal"), lw=1, zorder=0)
        axes.set(xscale="log", yscale="log", xlabel="core-seconds per run")
        axes.margins(x=0.15, y=0.1)
    panels[0].axhline(1.0, color=THIRD, ls="--", lw=0.8)
    panels[0].set_ylabel("density error / seed-to-seed spread")
    panels[1].set_ylabel("relative energy above the lowest unfolded")
    return figure


@STYLED
def folding_figure(
    tissues: Mapping[str, "Tissue"], shares: Mapping[str, NDArray[np.float64]], mould: Mould
) -> Figure:
    """Tissues from above, cells coloured by the share (cells,) of their bonds that are inverted."""
    figure = new_figure(9.0, 3.2)
    panels = figure.subplots(1, len(tissues), sharex=True, sharey=True)
    for axes, (name, s) in zip(panels, tissues.items(), strict=True):
        order = np.argsort(shares[name], kind="stable")
        x, y = s.positions[order, :2].T
        points = axes.scatter(
            x, y, c=shares[name][order], s=6, cmap="viridis", vmin=0, vmax=0.5, linewidths=0, rasterized=True
        )
        draw_mould(axes, mould, fill=False)
        x0, y0, x1, y1 = mould.outline.bounds
        axes.set(xlim=(x0 - 1, x1 + 1), ylim=(y0 - 1, y1 + 1), aspect="equal")
        axes.set_title(
            f"{name}: $E$ = {s.energy:.2f}, reversed {100 * s.inverted_fraction:.1f} %", fontsize=9
        )
        axes.set_xlabel("$x$ / $l_0$")
    panels[0].set_ylabel("$y$ / $l_0$")
    figure.colorbar(points, ax=panels, label="share of a cell's bonds inverted", shrink=0.8)
    return figure


def _method_colour(method: str) -> str:
    """Colour of a method's family."""
    families = {"anneal": "#8a3355", "draft": "#b8860b", "standard": SIMULATED, "reference": "#3c8a5a"}
    return next((colour for name, colour in families.items() if method.startswith(name)), PREDICTED)
