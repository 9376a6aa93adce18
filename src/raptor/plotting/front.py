"""`plot`: a picture of any result of the package."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from raptor.core.errors import RaptorError
from raptor.dataset.result import load_fields
from raptor.fields.labelled import mould_of
from raptor.moulds.geometry import Mould
from raptor.moulds.reading import read_mould
from raptor.moulds.summary import summarise
from raptor.plotting.drawing import PARAMETER_LABELS, fields_figure, mould_figure
from raptor.plotting.tissue import tissue_figure
from raptor.symmetry import FIELDS

if TYPE_CHECKING:
    import xarray as xr

NUMBERS = PARAMETER_LABELS | {"area_ratio": "$A/A_0$", "width_ratio": "$w/w_0$"}


def plot(what: Any, *, fields: bool = False, photograph: Any = None) -> Figure:
    """Draw a mould, a simulated or a predicted tissue, its fields, a fit, or a measured photograph.

    Parameters
    ----------
    what : Mould, Tissue, Prediction, Dataset of fields, FittedTissue, MeasuredPhotograph, str or Path
        A string or a path is a mould (a library name or a file), or a netCDF file of a tissue. The error
        `MeasurementError` of a photograph is drawn too.
    fields : bool
        Draw the eight fields of a tissue, instead of density, directors, tethers and numbers.
    photograph : MeasuredPhotograph, optional
        Of a fit: what it was measured in, drawn with the tissue at the fit over it.

    Returns
    -------
    matplotlib.figure.Figure
        Its method `savefig` writes it; a notebook displays it.

    Raises
    ------
    RaptorError
        If objects of this type cannot be drawn.
    """
    if isinstance(what, (str, Path)):
        what = load_fields(what) if Path(what).suffix == ".nc" else read_mould(what)
    if isinstance(what, Mould):
        return mould_figure(what, summarise(what).rows)
    if hasattr(what, "minimum"):
        from raptor.plotting.fitted import fitted_figure

        return fitted_figure(what, photograph)
    if hasattr(what, "picture"):  # imaging is not loaded for other pictures
        from raptor.imaging.report import MeasurementError
        from raptor.plotting.overlay import overlay_figure, refused_figure

        if isinstance(what, MeasurementError):
            return refused_figure(what)
        return overlay_figure(what.picture, what.mould, what.measurement)
    if hasattr(what, "to_dataset"):
        what = what.to_dataset()
    if hasattr(what, "data_vars"):
        return draw_fields(what) if fields else tissue_figure(what)
    raise RaptorError(
        f"cannot draw an object of type {type(what).__name__}; give a mould, a tissue or its fields"
    )


def draw_fields(fields: "xr.Dataset") -> Figure:
    """The eight fields of one tissue beside its mould, parameters and ratios."""
    stack = np.stack([fields[name].to_numpy() for name in FIELDS])
    figure = fields_figure({str(fields.attrs.get("method", "")): stack}, mould_of(fields))
    said = [f"{label} = {float(fields[name]):.3g}" for name, label in NUMBERS.items()]
    figure.axes[0].set_xlabel("\n".join(said))
    return figure
