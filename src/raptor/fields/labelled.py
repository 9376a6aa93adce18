"""Fields with names: what one tissue looks like, as an xarray Dataset that needs nothing else at hand."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.frame import IMAGE_SIZE, pixel_centres
from raptor.moulds.cast import CastMould
from raptor.moulds.geojson import from_feature
from raptor.moulds.geometry import Mould
from raptor.parameters import PARAMETERS, CellParameters
from raptor.symmetry import FIELDS

if TYPE_CHECKING:
    import xarray as xr

LONG_NAMES = {
    "density": "cells per pixel",
    "tension": "sum over cells of their mean bond tension, in kappa0 l0 per pixel",
    "sxsx": "sum over cells of sx sx, per pixel", "sysy": "sum over cells of sy sy, per pixel",
    "szsz": "sum over cells of sz sz, per pixel", "sxsy": "sum over cells of sx sy, per pixel",
    "sxsz": "sum over cells of sx sz, per pixel", "sysz": "sum over cells of sy sz, per pixel",
}  # fmt: skip


def labelled(
    fields: NDArray[np.floating], cast: CastMould, parameters: CellParameters, **attributes: Any
) -> "xr.Dataset":
    """Fields (8, y, x) as a Dataset of eight variables (y, x), with masks, parameters and mould.

    Coordinates are `x` and `y` (pixel centres, l0), the masks `depression` and `tethers` (y, x) and the three
    parameters; the attribute `mould` is the mould as GeoJSON (`mould_of` reads it).

    Parameters
    ----------
    attributes : Any
        Further attributes of the Dataset, such as `threshold`.

    Raises
    ------
    RaptorError
        Where the depression covers no pixel.
    """
    import xarray as xr  # here: what only simulates need not wait for it

    plane = ("y", "x")
    along = {axis: (axis, pixel_centres(cast.pixels), named(f"pixel centre {axis}, in l0")) for axis in "yx"}
    masks = {
        "depression": (plane, cast.depression, named("whether cells may be there")),
        "tethers": (plane, cast.tethers, named("whether a tether stands there")),
    }
    values = {name: ((), value, named(PARAMETERS[name])) for name, value in asdict(parameters).items()}
    return xr.Dataset(
        {name: (plane, image, named(LONG_NAMES[name])) for name, image in zip(FIELDS, fields, strict=True)},
        {**along, **masks, **values},
        {
            "mould": json.dumps(cast.mould.as_feature()),
            "frame_size": IMAGE_SIZE,
            "layers": cast.layers,
            **attributes,
        },
    )


def named(long_name: str, units: str = "1") -> Mapping[str, str]:
    """Attributes of a variable; "1" is the unit of numbers without dimension (CF conventions)."""
    return {"long_name": long_name, "units": units}


def mould_of(dataset: "xr.Dataset") -> Mould:
    """The mould of a Dataset that `labelled` made, or of a file of one.

    Raises
    ------
    RaptorError
        Where it names none.
    """
    try:
        feature = json.loads(dataset.attrs["mould"])
    except (KeyError, TypeError, ValueError) as error:
        raise RaptorError(
            "these fields do not say in which mould they lie; give a result of RAPTOR, or its file"
        ) from error
    return from_feature(feature)
