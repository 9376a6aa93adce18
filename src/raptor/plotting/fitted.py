"""One fit for people: the photograph, the tissue at the fit, and what the measurement leaves open."""

from typing import TYPE_CHECKING, Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from raptor.fitting.fitted import FittedTissue
from raptor.imaging.report import MeasuredPhotograph
from raptor.parameters import BOUNDS, PARAMETERS
from raptor.plotting.drawing import PARAMETER_LABELS, PREDICTED, SIMULATED, STYLED, THIRD, new_figure
from raptor.plotting.overlay import BELOW, draw_measured
from raptor.plotting.tissue import draw_tissue, height_of, write_rows

if TYPE_CHECKING:
    import xarray as xr

FITTED = "#7be07b"  # on grey, beside the colours of an overlay


@STYLED
def fitted_figure(fit: FittedTissue, photograph: MeasuredPhotograph | None = None) -> Figure:
    """The tissue at a fit, on the photograph and by itself, and how well each parameter is determined.

    Parameters
    ----------
    photograph : MeasuredPhotograph, optional
        What the ratios were measured in.
    """
    fields = fit.tissue.to_dataset()
    rows = dict(fit.table) | ({"warning": fit.warning} if fit.warning else {})
    below = max(1.5, 0.19 * len(rows))
    height = max(2.4, below, 4.2 * height_of(fit.mould)) if photograph is None else 3.9
    figure = new_figure(10.4, height + below + 0.4)
    top, bottom = cast(Any, figure.subfigures(2, 1, height_ratios=[height, below + 0.4]))
    left, right = top.subplots(1, 2)
    if photograph is None:
        draw_tissue(top, left, fields, fit.mould)
        words, axes = right, bottom.subplots(1, 3)
    else:
        _draw_photograph(left, photograph, fields)
        draw_tissue(top, right, fields, fit.mould)
        words, *axes = bottom.subplots(1, 4, width_ratios=[2.6, 1, 1, 1])
    write_rows(words, rows)
    for each, name in zip(axes, PARAMETERS, strict=True):
        _draw_parameter(each, fit, name)
    return figure


def _draw_photograph(axes: Axes, photograph: MeasuredPhotograph, fields: "xr.Dataset") -> None:
    """The photograph with the outlines of the tissue, as measured and at the fit."""
    registration = photograph.measurement.registration
    draw_measured(axes, photograph.picture, photograph.mould, photograph.measurement)
    x, y = np.meshgrid(fields["x"], fields["y"])
    pixels = registration.to_pixels(np.column_stack([x.ravel(), y.ravel()])).reshape(*x.shape, 2)
    level = float(fields.attrs["threshold"])
    axes.contour(pixels[..., 0], pixels[..., 1], fields["density"], [level], colors=FITTED, linewidths=1.2)
    axes.plot([], [], color=FITTED, label="tissue at the fit")
    axes.legend(**BELOW, ncols=4)
    axes.set_title("the photograph", loc="left")


def _draw_parameter(axes: Axes, fit: FittedTissue, name: str) -> None:
    """How well a value of one parameter explains the measurement, its interval, and the fit."""
    value, bounds = getattr(fit.parameters, name), BOUNDS[name]
    known = name not in fit.open
    if name in fit.intervals:
        axes.axvspan(*fit.intervals[name], color=SIMULATED, alpha=0.15, lw=0)
    if fit.posterior:
        profile = fit.posterior["profiles"][name]
        heights = np.array([-np.inf if each is None else each for each in profile["log_likelihood"]])
        axes.fill_between(profile["value"], np.exp(heights), color=SIMULATED, alpha=0.6, lw=0)
    axes.axvline(value, color=PREDICTED, lw=1.5)
    axes.set(xlim=(bounds.lower, bounds.upper), ylim=(0, 1.05), yticks=[], xlabel=PARAMETER_LABELS[name])
    axes.set_title(f"{value:.2f}" if known else "left open", color="black" if known else THIRD)
