"""A picture for checking a measurement by eye."""

from textwrap import wrap
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from raptor.imaging.pictures import Picture
from raptor.imaging.registration import Registration
from raptor.imaging.report import MeasurementError
from raptor.imaging.tissue import Measurement
from raptor.moulds import Mould
from raptor.moulds.cast import central_section
from raptor.plotting.drawing import PREDICTED, SIMULATED, STYLED, THIRD, new_figure

MOULD, OUTLINE, SECTION = "#4fb3ff", "#ff3b30", "#ffd60a"  # distinguishable on grey
BELOW: dict[str, Any] = {
    "loc": "upper center", "bbox_to_anchor": (0.5, 0), "fontsize": 7, "frameon": False
}  # fmt: skip


@STYLED
def overlay_figure(picture: Picture, mould: Mould, measurement: Measurement) -> Figure:
    """The picture with mould, outline and central section; histogram of brightness, with the threshold."""
    figure = new_figure(9.0, 4.2)
    axes, histogram = figure.subplots(1, 2, width_ratios=[1.7, 1])
    draw_measured(axes, picture, mould, measurement)
    registration = measurement.registration
    residual = "" if np.isnan(registration.residual) else f", residual {registration.residual:.2f} $l_0$"
    axes.set_title(
        f"$A/A_0$ = {measurement.area_ratio:.3f}, $w/w_0$ = {measurement.width_ratio:.3f}\n"
        f"registered by {registration.method}{residual}"
    )
    _draw_histogram(histogram, measurement)
    return figure


def draw_measured(axes: Axes, picture: Picture, mould: Mould, measurement: Measurement) -> None:
    """The picture with mould, central section and the tissue's outline."""
    registration = measurement.registration
    _draw_photograph(axes, picture, mould, registration)
    section = central_section(mould).intersection(mould.outline)
    _draw(axes, section, registration, SECTION, linestyle=":", label="central section")
    for ring in _rings(measurement.outline):
        _draw(axes, ring, registration, OUTLINE)
    for part in shapely.get_parts(section.intersection(measurement.outline)):
        _draw(axes, part, registration, SECTION, linewidth=2)
    axes.plot([], [], color=OUTLINE, label="tissue")
    axes.legend(**BELOW, ncols=3)


@STYLED
def refused_figure(refused: MeasurementError) -> Figure:
    """A photograph that was refused, why, and where the mould was found, if anywhere."""
    figure = new_figure(6.0, 5.0)
    axes = figure.subplots()
    _draw_photograph(axes, refused.picture, refused.mould, refused.registration)
    if refused.registration is not None:
        axes.legend(**BELOW)
    axes.set_title("refused: " + "\n".join(wrap(str(refused), 85)), loc="left", fontsize=8, color=OUTLINE)
    return figure


def _draw_photograph(axes: Axes, picture: Picture, mould: Mould, registration: Registration | None) -> None:
    """The picture, with the mould and the numbers of its tethers where it is registered."""
    rows, columns = picture.values.shape
    axes.imshow(picture.values, cmap="gray")
    axes.set(xticks=[], yticks=[], xlim=(0, columns), ylim=(rows, 0))
    if registration is None:
        return
    for number, tether in enumerate(mould.tethers, start=1):
        _draw(axes, tether.polygon.exterior, registration, MOULD)
        centre = registration.to_pixels(shapely.get_coordinates(tether.polygon.centroid))[0]
        axes.annotate(str(number), centre, color=MOULD, fontsize=7, ha="center", va="center")
    _draw(axes, mould.outline.exterior, registration, MOULD, label="mould")


def _draw_histogram(axes: Axes, measurement: Measurement) -> None:
    seen = measurement.brightness[measurement.read]
    bright = measurement.tissue.value == "bright"
    sides: dict[str, NDArray[np.float64]] = {
        "tissue": seen[(seen > measurement.threshold) == bright],
        "floor": seen[(seen > measurement.threshold) != bright],
    }
    bins = np.linspace(seen.min(), seen.max(), 80)
    for (name, values), colour in zip(sides.items(), (PREDICTED, SIMULATED), strict=True):
        axes.hist(values, bins=list(bins), color=colour, label=name)
    axes.axvline(measurement.threshold, color=THIRD, ls="--", label=f"threshold {measurement.threshold:.3g}")
    axes.set(
        xlabel="brightness relative to the plate, corrected", ylabel="pixels of the depression", yticks=[]
    )
    axes.legend(frameon=False, fontsize=7, loc="upper right")  # the best place takes long to find


def _draw(
    axes: Axes, line: shapely.Geometry, registration: Registration, colour: str, **style: object
) -> None:
    options = {"linewidth": 0.9, "color": colour} | style
    axes.plot(*registration.to_pixels(shapely.get_coordinates(line)).T, **options)  # type: ignore[arg-type]


def _rings(shape: shapely.Geometry) -> list[shapely.LinearRing]:
    return [ring for part in shapely.get_parts(shape) for ring in (part.exterior, *part.interiors)]
