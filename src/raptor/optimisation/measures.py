"""What a tissue is judged by: measures of its fields, simulated and predicted alike."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import radians

import numpy as np
from numpy.typing import NDArray

from raptor.fields.directors import alignment_along, anisotropy, long_side
from raptor.fields.resample import deconvolve
from raptor.fields.shape import area_above, outside
from raptor.fields.tethers import OPEN
from raptor.frame import pixel_centres, pixel_size
from raptor.moulds.cast import CastMould
from raptor.moulds.raster import tether_depth
from raptor.optimisation.spec import DIMENSION, Measured
from raptor.raster import density_threshold

FINE = 128
"""Pixels along a side, at least, of images in which edges are looked for: 0.5 l0 each."""
PEAK = 0.95  # of cells stay below the peak tension


@dataclass(frozen=True)
class View:
    """A mould as measures see it, on a raster of fields.

    Parameters
    ----------
    cast : CastMould
    pixels : int
        Along a side of the fields that are measured, block averages times the pixel's area.
    """

    cast: CastMould
    pixels: int

    @cached_property
    def axes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Place of pixel centres (y, x) along the long and short side, over half of each."""
        centre, half = self.cast.long_axis
        points = pixel_centres(self.pixels)
        x, y = points[None, :] - centre[0], points[:, None] - centre[1]
        long = float(np.hypot(*half))
        short = self.short / 2
        return (x * half[0] + y * half[1]) / long**2, (y * half[0] - x * half[1]) / long / short

    @cached_property
    def short(self) -> float:
        """The short side of the outline's box along its long axis, l0."""
        centre, half = self.cast.long_axis
        corners = np.asarray(self.cast.mould.outline.exterior.coords) - centre
        return float(np.ptp(corners @ np.array([-half[1], half[0]])) / np.hypot(*half))

    @property
    def long(self) -> float:
        """The long side, l0."""
        return float(2 * np.hypot(*self.cast.long_axis[1]))

    def within(self, region: tuple[float, float, float, float]) -> NDArray[np.bool_]:
        """Pixels (y, x) of a region, in parts of the half sides."""
        u, v = self.axes
        x0, y0, x1, y1 = region
        return (x0 <= u) & (u <= x1) & (y0 <= v) & (v <= y1)

    @cached_property
    def posts(self) -> NDArray[np.bool_]:
        """Pixels of each tether (tethers, y, x), on the fine raster."""
        side = self.fine
        found = [tether_depth(tether, side, reach=0.5) >= 0 for tether in self.cast.mould.tethers]
        return np.array(found, dtype=bool).reshape(-1, side, side)

    @property
    def fine(self) -> int:
        """Pixels along a side of the fine raster."""
        return max(FINE, self.pixels)


def measure(
    what: Measured, fields: NDArray[np.floating], view: View, threshold: float, unit: float = 1.0
) -> float:
    """One measure of fields (8, y, x), per pixel; NaN where there is nothing to measure.

    Parameters
    ----------
    threshold : float
        Density above which there is tissue, over the simulations' (`density_threshold`).
    unit : float
        Of lengths, per l0.
    """
    name = what.measure
    factor = unit ** DIMENSION.get(name, 0)
    if name in OF_MOULD:
        return factor * OF_MOULD[name](view)
    if name in OF_EDGE:
        return factor * OF_EDGE[name](fine_density(fields, view), threshold, view)
    part = fields if what.region is None else fields * view.within(what.region)
    if name == "alignment":
        return directed(part, view, what.axis)
    return OF_CELLS[name](part, threshold * density_threshold(view.cast.layers, view.pixels))


def directed(fields: NDArray[np.floating], view: View, axis: str | float) -> float:
    """Alignment along an axis, 1 to -1: see `directors.alignment_along`."""
    turned = 0.0 if axis == "long" else 90.0 if axis == "short" else float(axis)
    return alignment_along(fields, long_side(view.cast) + radians(turned))


def evenness(fields: NDArray[np.floating], threshold: float) -> float:
    """1 less the coefficient of variation of the density, each cell counting once."""
    density = fields[0].astype(np.float64)
    cells = density.sum()
    mean = _share((density**2).sum(), cells)
    spread = _share((density * (density - mean) ** 2).sum(), cells)
    return 1 - _share(np.sqrt(spread), mean)


def tension(fields: NDArray[np.floating], threshold: float) -> float:
    """Mean tension of a cell, kappa0 l0."""
    return _share(fields[1].sum(dtype=np.float64), fields[0].sum(dtype=np.float64))


def peak_tension(fields: NDArray[np.floating], threshold: float) -> float:
    """Local mean tension that 95 % of the cells stay below, kappa0 l0."""
    tissue = fields[0] > threshold
    if not tissue.any():
        return float("nan")
    cells, local = fields[0][tissue], fields[1][tissue] / fields[0][tissue]
    order = np.argsort(local)
    return float(local[order][np.searchsorted(np.cumsum(cells[order]), PEAK * cells.sum())])


def fine_density(fields: NDArray[np.floating], view: View) -> NDArray[np.floating]:
    """Density (y, x) on the fine raster, over the threshold of simulations."""
    fine: NDArray[np.floating] = deconvolve(fields[0] * (view.pixels / view.fine) ** 2, view.fine)
    return fine / density_threshold(view.cast.layers, view.fine)


def extent(along: NDArray[np.float64], tissue: NDArray[np.bool_]) -> float:
    """Reach of tissue over places, ends included."""
    return float(np.ptp(along[tissue])) if tissue.any() else float("nan")


def all_held(fields: NDArray[np.floating], view: View, threshold: float) -> bool:
    """Whether tissue encloses every tether: see `tethers.seen_held`."""
    free = outside(fine_density(fields, view), OPEN * threshold)
    return not (view.posts & free).any()


def _length(density: NDArray[np.floating], threshold: float, view: View) -> float:
    fine = View(view.cast, view.fine)
    return extent(fine.axes[0], density > threshold) * fine.long / 2 + pixel_size(view.fine)


def _width(density: NDArray[np.floating], threshold: float, view: View) -> float:
    fine = View(view.cast, view.fine)
    return extent(fine.axes[1], density > threshold) * fine.short / 2 + pixel_size(view.fine)


def _area(density: NDArray[np.floating], threshold: float, view: View) -> float:
    return area_above(density - threshold) * pixel_size(view.fine) ** 2


def _share(part: float, whole: float) -> float:
    return float(part / whole) if whole > 0 else float("nan")


OF_CELLS: dict[str, Callable[[NDArray[np.floating], float], float]] = {
    "anisotropy": lambda fields, threshold: anisotropy(fields),
    "evenness": evenness,
    "tension": tension,
    "peak_tension": peak_tension,
}
OF_EDGE: dict[str, Callable[[NDArray[np.floating], float, View], float]] = {
    "area": _area,
    "length": _length,
    "width": _width,
}
OF_MOULD: dict[str, Callable[[View], float]] = {
    "mould_length": lambda view: view.long,
    "mould_width": lambda view: view.short,
    "cells": lambda view: float(view.cast.n_cells),
    "tethers": lambda view: float(len(view.cast.mould.tethers)),
}
