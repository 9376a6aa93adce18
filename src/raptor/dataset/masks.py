"""The masks of a mould as a file: the image that a surrogate's networks are given."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path
from raptor.dataset.netcdf import header
from raptor.fields.labelled import labelled_masks
from raptor.moulds.geometry import Mould
from raptor.moulds.reading import as_mould

if TYPE_CHECKING:
    import xarray as xr

WHITE, GREY, RED = (255, 255, 255), (90, 90, 90), (200, 30, 30)
SUFFIXES = (".nc", ".png")


def rasterise(mould: Mould | str | Path, pixels: int = 256) -> "xr.Dataset":
    """Masks of a mould's depression and tethers (y, x), 1 where the centre of a pixel lies inside.

    Networks are given averages of these over blocks of pixels.

    Parameters
    ----------
    mould : Mould, str or Path
        A mould, or what `read_mould` reads: a name of the library, or a file.
    pixels : int
        Along a side of the frame of 62.5 l0.

    Raises
    ------
    RaptorError
        If the mould cannot be read, or covers no pixel.
    """
    return labelled_masks(as_mould(mould), pixels)


def require_masks_name(path: Path) -> None:
    """Raise a RaptorError unless masks can be written under a name."""
    if path.suffix.lower() not in SUFFIXES:
        raise RaptorError(f"{path} is no name for masks; give one that ends in {' or '.join(SUFFIXES)}")


def write_masks(masks: "xr.Dataset", path: Path) -> None:
    """Write masks as netCDF, or as a PNG picture that can be read as a mould: y up, a pixel a pixel."""
    require_masks_name(path)
    with atomic_path(path) as temporary:
        if path.suffix.lower() == ".nc":
            about = header("Masks of a mould", "masks")
            masks.astype("i1").assign_attrs(about).to_netcdf(temporary, engine="netcdf4")
            return
        picture = np.full((*masks["depression"].shape, 3), WHITE, np.uint8)
        picture[masks["depression"].to_numpy()] = GREY
        picture[masks["tethers"].to_numpy()] = RED
        Image.fromarray(picture[::-1]).save(temporary, format="PNG")
