"""One tissue for people: density and directors in its mould, tethers held and lost, and its numbers."""

from collections.abc import Mapping
from math import floor, log10
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from raptor.fields.directors import directors
from raptor.fields.labelled import mould_of
from raptor.moulds.geometry import Mould
from raptor.plotting.drawing import HALF, SEQUENTIAL, STYLED, THIRD, new_figure
from raptor.plotting.sweep import draw_directors
from raptor.symmetry import FIELDS

if TYPE_CHECKING:
    import xarray as xr

RIM = 2.5  # l0 around the mould
WARNING = "#b5402f"


@STYLED
def tissue_figure(fields: "xr.Dataset") -> Figure:
    """Density, directors and tethers of one tissue, a scale bar, and its numbers with their 95 % bands.

    Parameters
    ----------
    fields : Dataset
        As `raptor.fields.labelled` makes it, of a simulation or a prediction.
    """
    mould = mould_of(fields)
    rows = _rows(fields)
    width = 5.2
    height = width * 0.8 * height_of(mould)
    figure = new_figure(width, height + 0.55 + 0.19 * len(rows))
    top, bottom = figure.subplots(2, 1, height_ratios=[height, 0.19 * len(rows)])
    tension = draw_tissue(figure, top, fields, mould)
    rows["tension"] = rf"at most {tension:.2g} $\kappa_0 l_0$ a cell, at the triangle"
    write_rows(bottom, rows)
    return figure


def height_of(mould: Mould) -> float:
    """Height over width of the part of the frame that is drawn."""
    x0, y0, x1, y1 = mould.outline.bounds
    return float((y1 - y0 + 3 * RIM) / (x1 - x0 + 2 * RIM))


def draw_tissue(figure: Figure, axes: Axes, fields: "xr.Dataset", mould: Mould) -> float:
    """Density, directors and tethers of a tissue, with a scale bar; returns the highest tension of a cell."""
    x0, y0, x1, y1 = mould.outline.bounds
    stack = np.stack([fields[name].to_numpy() for name in FIELDS])
    threshold = float(fields.attrs["threshold"])
    as_cast = float(fields.attrs["n_cells"]) / float(fields["depression"].sum())
    shown = axes.imshow(
        np.ma.masked_less(stack[0], threshold) / as_cast,
        origin="lower", extent=(-HALF, HALF, -HALF, HALF), cmap=SEQUENTIAL, vmin=0.0,
    )  # fmt: skip
    draw_directors(axes, directors(stack, threshold))
    x, y, tension = _highest_tension(stack, fields, threshold)
    axes.plot(x, y, "^", color="white", mec="black", ms=6)
    _draw_walls(axes, mould, _lost(fields))
    _draw_scale(axes, mould)
    axes.set(xlim=(x0 - RIM, x1 + RIM), ylim=(y0 - 2 * RIM, y1 + RIM), aspect="equal")
    axes.axis("off")
    axes.set_title(_title(fields, mould), loc="left")
    figure.colorbar(shown, ax=axes, shrink=0.7, label="density, over that as cast")
    return tension


def write_rows(axes: Axes, rows: Mapping[str, str]) -> None:
    """A table of names and values; in red what warns."""
    axes.axis("off")
    for number, (name, value) in enumerate(rows.items()):
        place: dict[str, Any] = {
            "y": 1 - (number + 0.5) / len(rows),
            "transform": axes.transAxes,
            "va": "center",
        }
        colour = WARNING if name in ("unusual", "warning") else "black"
        axes.text(0.0, s=name, color=colour, **place)
        axes.text(0.2, s=value, color=colour, **place)


def _title(fields: "xr.Dataset", mould: Mould) -> str:
    values = [float(fields[name]) for name in ("delta", "kappa_nnn", "kappa_nnnn")]
    method = str(fields.attrs.get("method", "tissue"))
    return (
        f"{mould.name.replace('_', ' ')}: {method}, "
        r"$\Delta$ = {:.3g}, $\kappa$ = {:.3g}, {:.3g}".format(*values)
    )


def _rows(fields: "xr.Dataset") -> dict[str, str]:
    """The tissue's numbers in words, by name."""
    rows = {
        "A/A0": f"{_with_band(fields, 'area_ratio')}  area over that as cast",
        "w/w0": f"{_with_band(fields, 'width_ratio')}  width across the middle over that as cast",
        "alignment": f"{_with_band(fields, 'alignment', 2)}  with the long side: 1 along it, -1 across",
        "anisotropy": f"{_with_band(fields, 'anisotropy', 2)}  local alignment in any direction, 0 to 1",
    }
    held = fields["held"].to_numpy() if "held" in fields.coords else np.empty(0)
    encircled = np.isfinite(held)
    if encircled.any():
        lost = _lost(fields)
        names = f"; lost: {', '.join(str(number + 1) for number in lost)}" if lost else ""
        rows["tethers"] = f"{encircled.sum() - len(lost)} of {encircled.sum()} held{names}{_doubtful(fields)}"
        if "contact" in fields.coords:
            least = float(fields["contact"][encircled].min())
            rows["tethers"] += f"; at least {least:.0%} of a rim in contact"
    if fields.attrs.get("unusual"):
        rows["unusual"] = str(fields.attrs["unusual"])
    return rows


def _highest_tension(
    stack: NDArray[np.floating], fields: "xr.Dataset", threshold: float
) -> tuple[float, float, float]:
    """Where in the tissue (l0) the tension of a cell is highest, and its value."""
    tension = np.where(stack[0] > threshold, stack[1] / np.maximum(stack[0], threshold), -np.inf)
    y, x = np.unravel_index(np.argmax(tension), tension.shape)
    return float(fields["x"][x]), float(fields["y"][y]), float(tension[y, x])


def _with_band(fields: "xr.Dataset", name: str, digits: int = 3) -> str:
    """A measure, with the half width of its 95 % band where it has one."""
    band = f"{name}_band"
    half = rf" $\pm$ {float(fields[band][-1]):.{digits}f}" if band in fields.coords else ""
    return f"{float(fields[name]):.{digits}f}{half}"


def _lost(fields: "xr.Dataset") -> list[int]:
    """Numbers, from 0, of the tethers that tissue does not hold."""
    return np.flatnonzero(fields["held"].to_numpy() < 0.5).tolist() if "held" in fields.coords else []


def _doubtful(fields: "xr.Dataset") -> str:
    """The chance of being held of the tethers for which a prediction is not sure."""
    if fields.attrs.get("method") != "prediction":
        return ""
    chances = enumerate(fields["held"].to_numpy(), start=1)
    doubts = [f"{number} by {chance:.0%}" for number, chance in chances if 0.05 < chance < 0.95]
    return f"; chance of tether {', '.join(doubts)}" if doubts else ""


def _draw_walls(axes: Axes, mould: Mould, lost: list[int]) -> None:
    """Outline and tethers; those that are lost hollow, with a cross and their number."""
    axes.plot(*np.asarray(mould.outline.exterior.coords).T, color="#444444", lw=1)
    for number, tether in enumerate(mould.tethers):
        corners = np.asarray(tether.polygon.exterior.coords)
        style: dict[str, Any] = {"facecolor": THIRD, "edgecolor": "black", "lw": 0.6}
        if number in lost:
            style = {"facecolor": "white", "edgecolor": WARNING, "lw": 1.2, "ls": "--"}
            centre = tether.polygon.centroid
            axes.plot(centre.x, centre.y, "x", color=WARNING, ms=6, mew=1.5)
            axes.annotate(
                str(number + 1), (centre.x, centre.y), xytext=(6, 6), textcoords="offset points",
                color=WARNING, fontsize=8,
            )  # fmt: skip
        axes.add_patch(Polygon(corners, closed=True, **style))


def _draw_scale(axes: Axes, mould: Mould) -> None:
    """A bar of a round length below the mould, in millimetres where they are known."""
    x0, y0, x1, _ = mould.outline.bounds
    unit = mould.mm_per_l0 or 1.0
    length = _round_length(0.25 * (x1 - x0) * unit)
    text = f"{length:g} mm" if mould.mm_per_l0 else f"{length:g} $l_0$"
    y = y0 - 0.7 * RIM
    axes.plot([x0, x0 + length / unit], [y, y], color="black", lw=2, solid_capstyle="butt")
    axes.text(x0 + length / unit + 0.5, y, text, va="center", fontsize=8)


def _round_length(length: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is no longer than a length."""
    power = 10.0 ** floor(log10(length))
    return max(step * power for step in (1, 2, 5) if step * power <= length)
