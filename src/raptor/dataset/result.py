"""The file of one tissue, simulated or predicted: its fields and all that is needed to draw them.

The fields are those of `raptor.fields.labelled`. A simulated tissue has its cells too, in the group `cells`,
which is a shard of one simulation (docs/data.md).
"""

from pathlib import Path
from typing import Any, Protocol

import netCDF4
import xarray as xr

from raptor.condor.simulate import Tissue
from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path, why_unreadable
from raptor.dataset.design import Run
from raptor.dataset.netcdf import header
from raptor.dataset.shards import write_model, write_simulations
from raptor.moulds.geometry import Mould

CELLS = "cells"
PACKED = {"zlib": True, "complevel": 4, "shuffle": True}


class Result(Protocol):
    """A simulated tissue or a prediction."""

    @property
    def mould(self) -> Mould:
        """The mould that it was cast in."""

    @property
    def numbers(self) -> dict[str, Any]:
        """Its numbers, by name."""

    def to_dataset(self) -> xr.Dataset:
        """Its images and numbers."""


def save(result: Result, path: str | Path) -> None:
    """Write a tissue or a prediction as netCDF, atomically.

    Raises
    ------
    RaptorError
        If the file cannot be written.
    """
    fields = result.to_dataset()
    method = fields.attrs["method"]
    images = {name: PACKED | {"dtype": "float32"} for name, image in fields.data_vars.items() if image.ndim}
    with atomic_path(Path(path)) as temporary:
        about = header(f"Fields of a tissue by {method}", method)
        fields.assign_attrs(about).to_netcdf(temporary, engine="netcdf4", encoding=images)
        if isinstance(result, Tissue):
            with netCDF4.Dataset(temporary, "a") as file:
                cells = file.createGroup(CELLS)
                cells.setncatts(about)
                write_model(cells, result.model, result.accuracy, "cpu")
                run = Run(0, result.mould.name, "test", result.parameters, result.seed)
                write_simulations(cells, [run], [result])


def load_fields(path: str | Path) -> xr.Dataset:
    """Read the fields of a file that `save` or a command of `raptor` wrote.

    Raises
    ------
    RaptorError
        If it is missing, locked, forbidden, truncated, or no such file.
    """
    path = Path(path)
    if not path.is_file():
        raise RaptorError(f"{path} does not exist; check the path")
    try:
        fields = xr.load_dataset(path, engine="netcdf4")
    except (OSError, ValueError) as error:
        raise RaptorError(f"{path} {why_unreadable(path, error)}") from error
    if "mould" not in fields.attrs or "density" not in fields:
        raise RaptorError(
            f"{path} does not hold the fields of one tissue; give a file from raptor simulate or predict"
        )
    return fields
