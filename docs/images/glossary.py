"""Draws the pictures of docs/glossary.md: workflow/env python docs/images/glossary.py."""

from pathlib import Path

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyArrowPatch

import raptor
from raptor.fields.directors import directors
from raptor.plotting import new_figure
from raptor.plotting.drawing import PREDICTED, SIMULATED, THIRD, draw_mould, save_picture
from raptor.plotting.sweep import draw_directors

FOLDER = Path(__file__).parent / "glossary"
ROD = {"lw": 3, "solid_capstyle": "round"}


def panel(width: float = 3.4, height: float = 2.1) -> Axes:
    """An empty picture without frame."""
    axes = new_figure(width, height).add_subplot()
    axes.set_aspect("equal")
    axes.axis("off")
    return axes


def write(axes: Axes, name: str) -> None:
    """Save a picture."""
    save_picture(axes.figure, FOLDER / f"{name}.png")


def arrow(
    axes: Axes, a: tuple[float, float], b: tuple[float, float], colour: str, style: str = "<->"
) -> None:
    """An arrow between two points."""
    axes.add_patch(
        FancyArrowPatch(a, b, arrowstyle=style, mutation_scale=9, color=colour, shrinkA=0, shrinkB=0)
    )


def lattice() -> None:
    """Cells of two layers, their spacing, and the bonds of one cell by shell."""
    axes = panel()
    x, y = np.meshgrid(np.arange(5), np.arange(4))
    axes.plot(x, y, "o", color=SIMULATED, ms=7)
    x, y = np.meshgrid(np.arange(4) + 0.5, np.arange(3) + 0.5)
    axes.plot(x, y, "o", color=SIMULATED, ms=7, mfc="white")
    arrow(axes, (1, 3), (2, 3), PREDICTED)
    axes.text(1.5, 3.15, "$l_0$", ha="center", color=PREDICTED, fontsize=12)
    axes.text(4.5, 2, "full: one layer\nhollow: the next", va="center")
    axes.set(xlim=(-0.3, 7), ylim=(-0.3, 3.7))
    write(axes, "spacing")
    axes = panel()
    centre = np.array([2, 2])
    signs = [(1, 1), (-1, 1), (1, -1), (-1, -1)]
    shells = (
        ([(1, 0), (0, 1), (-1, 0), (0, -1), *(0.5 * np.array(signs))], THIRD, "nearest: $\\kappa_0$"),
        (signs, SIMULATED, "second: $\\kappa_{NNN}$"),
        (
            [*(np.array(signs) * (1.5, 0.5)), *(np.array(signs) * (0.5, 1.5))],
            PREDICTED,
            "third: $\\kappa_{NNNN}$",
        ),
    )
    for shell, (neighbours, colour, text) in enumerate(shells):
        for step in neighbours:
            axes.plot(*np.transpose([centre, centre + step]), color=colour, lw=1.6, zorder=3 - shell)
            axes.plot(*(centre + step), "o", color=colour, ms=4)
        axes.text(4.1, 2.9 - 0.9 * shell, text, color=colour)
    axes.plot(*centre, "o", color="black", ms=8)
    axes.set(xlim=(0.2, 7), ylim=(0.2, 3.8))
    write(axes, "kappas")


def contraction() -> None:
    """Two pairs of cells: a bond along both keeps its length, one across both shortens by Delta."""
    axes = panel()
    for y, angle, length, text in (
        (2, 0, 2.0, "cells along their bond:\nit keeps its length $L$"),
        (0, np.pi / 2, 1.2, "cells across their bond:\nit shortens to $L(1-\\Delta)$"),
    ):
        ends = np.array([0.0, length])
        axes.plot(ends, [y, y], color=THIRD, lw=1)
        for x in ends:
            half = 0.35 * np.array([np.cos(angle), np.sin(angle)])
            axes.plot(*(np.array([[x], [y]]) + np.outer(half, (-1, 1))), color=SIMULATED, **ROD)
        axes.text(3.0, y, text, va="center")
    axes.set(xlim=(-0.6, 7), ylim=(-0.9, 2.8))
    write(axes, "delta")


def mould() -> None:
    """A mould with its parts named."""
    shown = raptor.Mould(
        shapely.box(-24, -10, 24, 10),
        (raptor.Circle(-18, 5, 1.5), raptor.Circle(-18, -5, 1.5), shapely.box(17, -7, 18.5, 7)),
    )
    axes = new_figure(3.6, 2.0).add_subplot()
    draw_mould(axes, shown)
    axes.axis("off")
    axes.set(xlim=(-26, 26), ylim=(-12, 18))
    for text, place, tip in (
        ("post (a tether)", (-12, 13), (-17.5, 6.5)),
        ("bar (a tether)", (16, 13), (17.5, 7.2)),
        ("depression", (0, 0), None),
    ):
        axes.text(*place, text, ha="center")
        if tip:
            axes.add_patch(
                FancyArrowPatch((place[0], place[1] - 0.6), tip, arrowstyle="->", mutation_scale=8)
            )
    write(axes, "mould")


def tissue() -> None:
    """A contracted tissue with its directors, and with its width."""
    made = raptor.simulate("four_post_rectangle", raptor.CellParameters(0.5, 0.5, 0.3), layers=3)
    stack = made.rasterised()
    threshold = made.cast_mould.threshold
    found = directors(stack, threshold)
    for name in ("director", "ratios"):
        axes = new_figure(3.6, 2.0).add_subplot()
        draw_mould(axes, made.mould, fill=False)
        grid = np.linspace(-31.25, 31.25, stack.shape[-1])
        if name == "director":
            axes.contourf(grid, grid, stack[0], [threshold, np.inf], colors=["#8fb3d9"], zorder=0.5)
            draw_directors(axes, found)
        else:
            axes.contourf(grid, grid, stack[0], [threshold, np.inf], colors=["#8fb3d9"], zorder=0.5)
            middle = stack[0][:, stack.shape[-1] // 2] > threshold
            arrow(axes, (0, grid[middle].min()), (0, grid[middle].max()), "black")
            arrow(axes, (6, -13.25), (6, 13.25), THIRD)
            axes.text(-1, 0, "$w$", ha="right", va="center")
            axes.text(7, 0, "$w_0$", va="center", color=THIRD)
            axes.text(-14, 0, "$A$", ha="center", va="center")
        axes.axis("off")
        axes.set(xlim=(-29, 29), ylim=(-15, 15))
        write(axes, name)


def alignments() -> None:
    """Three arrangements of cells: aligned with the mould, aligned locally, and not."""
    axes = panel(4.6, 1.7)
    rng = np.random.default_rng(1)
    for column, (text, angle) in enumerate(
        (
            ("alignment 1\nanisotropy 1", lambda x, y: 0.0),
            ("alignment 0\nanisotropy 1", lambda x, y: np.arctan2(y, x) + np.pi / 2),
            ("alignment 0\nanisotropy 0", lambda x, y: rng.uniform(0, np.pi)),
        )
    ):
        for x in np.linspace(-1, 1, 5):
            for y in np.linspace(-1, 1, 5):
                turn = angle(x, y)
                half = 0.17 * np.array([np.cos(turn), np.sin(turn)])
                centre = np.array([3.2 * column + x, y])
                axes.plot(*np.transpose([centre - half, centre + half]), color=SIMULATED, lw=1.8)
        axes.text(3.2 * column, -1.4, text, ha="center", va="top")
    axes.set(xlim=(-1.4, 7.8), ylim=(-2.6, 1.3))
    write(axes, "alignment")


def held() -> None:
    """A post that tissue encircles, and one that it has let go."""
    axes = panel()
    for x, text, shift in ((0, "held", 0.0), (4, "lost", 0.75)):
        if shift:
            ring = shapely.Point(x, shift + 0.9).buffer(0.9)
        else:
            ring = shapely.Point(x, 0).buffer(1.0).difference(shapely.Point(x, 0).buffer(0.5))
        axes.fill(*np.array(ring.exterior.coords).T, color="#8fb3d9")
        for hole in ring.interiors:
            axes.fill(*np.array(hole.coords).T, color="white")
        axes.add_patch(Circle((x, 0 if not shift else -0.4), 0.42, color=THIRD))
        axes.text(x, -1.5, text, ha="center")
    axes.set(xlim=(-1.5, 5.5), ylim=(-1.8, 2.8))
    write(axes, "held")


if __name__ == "__main__":
    for draw in (lattice, contraction, mould, tissue, alignments, held):
        draw()
