"""Conventions of the netCDF files that the package writes (CF-1.11)."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path, why_unreadable
from raptor.core.version import MODEL_VERSION, __version__

REFERENCES = (
    "Andrews et al., Rapid prediction of organisation in engineered corneal, glial and fibroblast "
    "tissues using machine learning and biophysical models (2025)"
)
LICENCE = "CC-BY-4.0"
LICENCE_URL = "https://creativecommons.org/licenses/by/4.0/"
"""Of the data and weights that the workflow makes; the code has its own (LICENSE)."""


@contextmanager
def create(path: Path, title: str, configuration: str) -> Iterator[netCDF4.Dataset]:
    """Create a netCDF-4 file of a data set atomically, with the attributes common to all and the licence.

    `configuration` is the hash of the configuration block that the file depends on.
    """
    with atomic_path(path) as temporary, netCDF4.Dataset(temporary, "w", format="NETCDF4") as file:
        file.setncatts(header(title, configuration) | {"license": f"{LICENCE}, {LICENCE_URL}"})
        yield file


def header(title: str, configuration: str) -> dict[str, Any]:
    """The attributes common to all files; `configuration` as in `create`."""
    return {
        "Conventions": "CF-1.11",
        "title": title,
        "source": f"RAPTOR {__version__}, model version {MODEL_VERSION}",
        "model_version": np.int64(MODEL_VERSION),
        "history": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ} written by RAPTOR {__version__}",
        "references": REFERENCES,
        "configuration": configuration,
    }


@contextmanager
def open_file(path: Path, group: str | None = None) -> Iterator[netCDF4.Dataset]:
    """Open a netCDF file, or a group of it, for reading.

    Raises
    ------
    RaptorError
        If it is missing, locked, forbidden, truncated, or not netCDF.
    """
    path = Path(path)
    if not path.is_file():
        raise RaptorError(f"{path} does not exist; make it with the workflow")
    try:
        file = netCDF4.Dataset(path)
    except OSError as error:
        raise RaptorError(f"{path} {why_unreadable(path, error)}") from error
    with file:
        file.set_auto_mask(False)
        yield file if group is None else file[group]


def variable(
    file: netCDF4.Dataset,
    name: str,
    dimensions: tuple[str, ...],
    values: Any,
    long_name: str,
    units: str = "1",
    **options: Any,
) -> Any:
    """Add a variable with its name, unit and values; numbers are compressed."""
    values = np.asarray(values)
    kind = str if values.dtype.kind in "OU" else values.dtype
    if kind is not str and dimensions:
        options = {"compression": "zlib", "complevel": 4, "shuffle": True} | options
    made = file.createVariable(name, kind, dimensions, **options)
    made.long_name = long_name
    made.units = units
    made[...] = values.astype(object) if kind is str else values
    return made
