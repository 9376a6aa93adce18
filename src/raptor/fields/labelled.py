"""Named fields of one tissue, as a self-contained xarray Dataset."""

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
from raptor.moulds.raster import mould_image
from raptor.parameters import PARAMETERS, CellParameters
from raptor.symmetry import FIELDS

if TYPE_CHECKING:
    import xarray as xr

PLANE = ("y", "x")
LONG_NAMES = {
    "density": "cells per pixel",
    "tension": "sum over cells of their mean bond tension, in kappa0 l0 per pixel",
    "sxsx": "sum over cells of sx sx, per pixel", "sysy": "sum over cells of sy sy, per pixel",
    "szsz": "sum over cells of sz sz, per pixel", "sxsy": "sum over cells of sx sy, per pixel",
    "sxsz": "sum over cells of sx sz, per pixel", "sysz": "sum over cells of sy sz, per pixel",
}  # fmt: skip

MEASURES = {
    "area_ratio": "A/A0: area of the tissue over its area as cast",
    "width_ratio": "w/w0: width of the tissue on the central section over its width as cast",
    "posts_lost": "number of tethers that tissue encircles in fewer than half of the layers",
    "alignment": "alignment of cells with the long side of the mould, from -1 (across) to 1",
    "anisotropy": "local alignment of cells in the plane, in any direction, from 0 to 1",
}
"""Numbers of a tissue."""

TETHER_MEASURES = {
    "held": "share of layers in which tissue encircles the tether; of a prediction, the chance that it does",
    "contact": "share of the rim of the tether with a cell within 1.5 l0",
}
"""Numbers of each tether; `held` is NaN for a tether that touches the outline."""


def labelled(
    fields: NDArray[np.floating],
    cast: CastMould,
    parameters: CellParameters,
    measures: Mapping[str, Any],
    **attributes: Any,
) -> "xr.Dataset":
    """Fields (8, y, x) as a Dataset of eight variables (y, x), with all that is needed to draw them.

    Coordinates are `x` and `y` (pixel centres, l0), the masks `depression` and `tethers` (y, x), the three
    parameters and the measures. The attribute `mould` is the mould as GeoJSON, which `mould_of` reads, and
    `frame_size` the side of the image, l0.

    Parameters
    ----------
    measures : mapping
        Numbers of `MEASURES` and of `TETHER_MEASURES`, by name.
    attributes : Any
        Further attributes of the Dataset, such as `threshold`.

    Raises
    ------
    RaptorError
        If the depression covers no pixel.
    """
    import xarray as xr  # here, because simulations do without it

    masks = labelled_masks(cast)
    numbers = {
        name: (("tether",) * np.ndim(value), value, named((PARAMETERS | MEASURES | TETHER_MEASURES)[name]))
        for name, value in {**asdict(parameters), **measures}.items()
    }
    return xr.Dataset(
        {name: (PLANE, image, named(LONG_NAMES[name])) for name, image in zip(FIELDS, fields, strict=True)},
        {**masks.coords, **masks.data_vars, **numbers},
        {
            **masks.attrs,
            "layers": cast.layers,
            "n_cells": cast.n_cells,
            **attributes,
        },
    )


def labelled_masks(mould: "Mould | CastMould", pixels: int = 256) -> "xr.Dataset":
    """Masks (y, x) of depression and tethers of a mould, with pixel centres and the mould.

    A mould that is cast has its own number of pixels.

    Raises
    ------
    RaptorError
        If the depression covers no pixel.
    """
    import xarray as xr

    image = mould_image(mould, pixels) if isinstance(mould, Mould) else mould.image
    masks = {
        "depression": (PLANE, image.depression, named("whether cells may lie here")),
        "tethers": (PLANE, image.tethers, named("whether there is a tether here")),
    }
    centres = pixel_centres(len(image.depression))
    axes = {axis: (axis, centres, named(f"pixel centre {axis}, in l0")) for axis in "yx"}
    shape = mould if isinstance(mould, Mould) else mould.mould
    about = {"mould": json.dumps(shape.as_feature()), "frame_size": IMAGE_SIZE}
    return xr.Dataset(masks, axes, about)


def named(long_name: str, units: str = "1") -> Mapping[str, str]:
    """Attributes of a variable; "1" is the unit of dimensionless numbers (CF conventions)."""
    return {"long_name": long_name, "units": units}


def mould_of(dataset: "xr.Dataset") -> Mould:
    """The mould of a Dataset from `labelled`, or of its file.

    Raises
    ------
    RaptorError
        If it names none.
    """
    try:
        feature = json.loads(dataset.attrs["mould"])
    except (KeyError, TypeError, ValueError) as error:
        raise RaptorError("these fields have no mould; give a result of RAPTOR, or its file") from error
    return from_feature(feature)
