"""Export of field stacks to the HDF5 layout of The Well.

R. Ohana et al., The Well (2024), arXiv:2412.00568; layout: docs/data_format.md and
scripts/check_thewell_formatting.py of its repository. One file per split; a simulation is a trajectory of
one time step. Axes are (trajectory, time, x, y), where ours are [y, x]; the masks of the mould do not depend
on time. In the plane the orientation products form a tensor (sxsx, sxsy, sysy), a vector (sxsz, sysz) and a
scalar (szsz).
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from raptor.core.files import atomic_path
from raptor.dataset.design import SPLITS
from raptor.dataset.netcdf import LICENCE, LICENCE_URL
from raptor.dataset.stack import read_samples, read_table
from raptor.frame import pixel_centres
from raptor.parameters import PARAMETERS
from raptor.symmetry import FIELDS

FOLDERS = {"train": "train", "validation": "valid", "test": "test"}
SCALARS = ("density", "tension", "szsz")
MASKS = ("depression", "tethers")
VECTOR = ("sxsz", "sysz")
TENSOR = ("sxsx", "sxsy", "sxsy", "sysy")


def write_well(stack: Path, folder: Path) -> list[Path]:
    """Write a stack as `folder`/data/{train,valid,test}/raptor.hdf5; returns the paths.

    Raises
    ------
    RaptorError
        If the stack cannot be read.
    """
    table = read_table(stack)
    written = []
    for split in SPLITS:
        rows = table.rows(split)
        if not rows:
            continue
        written.append(Path(folder) / "data" / FOLDERS[split] / "raptor.hdf5")
        written[-1].parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(written[-1]) as temporary, h5py.File(temporary, "w") as file:
            _describe(file, len(rows), table.pixels)
            _write_parameters(file, [table.parameters[row] for row in rows])
            _write_fields(file, stack, rows, table.pixels)
    return written


def _describe(file: h5py.File, samples: int, pixels: int) -> None:
    """Root attributes, axes and boundary conditions."""
    file.attrs.update(
        {
            "dataset_name": "raptor",
            "license": f"{LICENCE}, {LICENCE_URL}",
            "grid_type": "cartesian",
            "n_spatial_dims": 2,
            "n_trajectories": samples,
            "simulation_parameters": list(PARAMETERS),
        }
    )
    dimensions = file.create_group("dimensions")
    dimensions.attrs["spatial_dims"] = ["x", "y"]
    _add(dimensions, "time", np.zeros(1), sample_varying=False, time_varying=True)
    boundaries = file.create_group("boundary_conditions")
    for axis in ("x", "y"):
        _add(dimensions, axis, pixel_centres(pixels), sample_varying=False, time_varying=False)
        boundary = boundaries.create_group(f"{axis}_open")
        boundary.attrs.update({"associated_dims": [axis], "associated_fields": [], "bc_type": "OPEN"})
        boundary.attrs.update({"sample_varying": False, "time_varying": False})
        boundary["mask"] = np.isin(np.arange(pixels), (0, pixels - 1))
        boundary["values"] = np.zeros(2, np.float32)


def _write_parameters(file: h5py.File, parameters: Iterable[Any]) -> None:
    """Parameters of each trajectory as scalars; their range as the root attributes that a reader expects."""
    group = file.create_group("scalars")
    group.attrs["field_names"] = list(PARAMETERS)
    parameters = list(parameters)
    for name in PARAMETERS:
        values = np.array([getattr(p, name) for p in parameters])
        _add(group, name, values, sample_varying=True, time_varying=False)
        file.attrs[name] = [values.min(), values.max()]


def _write_fields(file: h5py.File, stack: Path, rows: list[int], pixels: int) -> None:
    """Fields of each order, one sample in memory at a time."""
    shape = (len(rows), 1, pixels, pixels)
    groups = [file.create_group(f"t{order}_fields") for order in (0, 1, 2)]
    made = {name: _field(groups[0], name, shape) for name in SCALARS}
    made |= {name: _field(groups[0], name, (len(rows), pixels, pixels), False) for name in MASKS}
    made["out_of_plane"] = _field(groups[1], "out_of_plane", (*shape, 2))
    made["orientation"] = _field(groups[2], "orientation", (*shape, 2, 2))
    made["orientation"].attrs.update({"symmetric": True, "antisymmetric": False})
    for group in groups:
        group.attrs["field_names"] = list(group)
    for row, sample in enumerate(read_samples(stack, rows)):
        images = {name: field.T for name, field in zip(FIELDS, sample.fields, strict=True)}
        images |= {"depression": sample.depression.T, "tethers": sample.tethers.T}
        for name in SCALARS:
            made[name][row, 0] = images[name]
        for name in MASKS:
            made[name][row] = images[name]
        made["out_of_plane"][row, 0] = np.stack([images[name] for name in VECTOR], axis=-1)
        tensor = np.stack([images[name] for name in TENSOR], axis=-1)
        made["orientation"][row, 0] = tensor.reshape(pixels, pixels, 2, 2)


def _field(group: h5py.Group, name: str, shape: tuple[int, ...], time_varying: bool = True) -> h5py.Dataset:
    chunks = (1, *shape[1:])
    field = group.create_dataset(name, shape, "f4", chunks=chunks, compression="gzip", shuffle=True)
    field.attrs.update({"dim_varying": [True, True], "sample_varying": True, "time_varying": time_varying})
    return field


def _add(group: h5py.Group, name: str, values: NDArray[np.float64], **attributes: bool) -> None:
    group[name] = values.astype(np.float32)
    group[name].attrs.update(attributes)
