"""The field stack: every simulation as eight images with its mould, in physical units."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import netCDF4
import numpy as np
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.dataset.design import Run
from raptor.dataset.netcdf import create, open_file, variable
from raptor.dataset.shards import MOVE_AWAY, Record, read_failures, read_shard, write_model
from raptor.fields.directors import alignment, anisotropy
from raptor.fields.labelled import LONG_NAMES, MEASURES
from raptor.fields.shape import shape_ratios
from raptor.frame import pixel_centres
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.parameters import PARAMETERS, CellParameters
from raptor.raster import density_threshold, rasterise
from raptor.symmetry import FIELDS


@dataclass(frozen=True)
class Sample:
    """One sample of a stack: fields (8, y, x), masks (y, x), measures and provenance."""

    fields: NDArray[np.float32]
    depression: NDArray[np.uint8]
    tethers: NDArray[np.uint8]
    parameters: CellParameters
    simulation: int
    seed: int
    mould: str
    split: str
    n_cells: int
    converged: bool
    area_ratio: float
    width_ratio: float
    posts_lost: int
    alignment: float
    anisotropy: float


def record_fields(record: Record, pixels: int, device: str = "cpu") -> NDArray[np.float32]:
    """The eight fields (8, pixels, pixels) of a simulation read from a shard."""
    cells = (record.positions, record.orientation, record.tension)
    if device == "cpu":
        return rasterise(*cells, pixels).astype(np.float32)
    import torch  # here, because without a GPU it is not needed

    from raptor.condor.gpu.raster import rasterise as rasterise_on

    return rasterise_on(*cells, pixels, torch.device(device))


def build_stack(
    path: Path,
    shards: Iterable[Path],
    runs: Sequence[Run],
    moulds: dict[str, Mould],
    pixels: int,
    *,
    simulation_configuration: str,
    configuration: str,
    device: str = "cpu",
    on_progress: Callable[[int], None] = lambda sample: None,
) -> None:
    """Rasterise every simulation of the shards into one file, sample by sample.

    Simulations that failed are left out; attribute `missing` names them.

    Raises
    ------
    RaptorError
        If a shard is missing, truncated, of another configuration or from another device, a simulation of
        the design is in none of them, or all of a split failed.
    """
    shards = list(shards)
    failed = _failed(shards, runs, simulation_configuration)
    by_id = {run.simulation: run for run in runs if run.simulation not in failed}
    order = {simulation: row for row, simulation in enumerate(sorted(by_id))}
    left = set(by_id)
    with create(path, "CONDOR fields of tissues in tethered moulds", configuration) as file:
        write = create_stack(file, len(by_id), pixels)
        file.shards = " ".join(Path(shard).name for shard in shards)
        file.missing = " ".join(str(simulation) for simulation in sorted(failed))
        for shard_path in shards:
            shard = read_shard(shard_path, simulation_configuration)
            if getattr(file, "device", shard.device) != shard.device:
                raise RaptorError(
                    f"shard {shard_path} was made on {shard.device} and earlier ones on {file.device}; move "
                    "those of one of them to another folder, and the workflow makes them again"
                )
            write_model(file, shard.model, shard.accuracy, shard.device)  # the same for all
            for record in shard.records:
                if record.simulation not in left:
                    raise RaptorError(
                        f"shard {shard_path} holds simulation {record.simulation}, which is not in the "
                        f"design or is in another shard too; {MOVE_AWAY}"
                    )
                left.remove(record.simulation)
                run = by_id[record.simulation]
                fields = record_fields(record, pixels, device)
                cast_mould = CastMould(moulds[run.mould], shard.model.layers, pixels)
                write(order[record.simulation], _sample(record, run, cast_mould, fields))
                on_progress(order[record.simulation])
        if left:
            raise RaptorError(f"simulations {sorted(left)[:8]} are in no shard; run the workflow again")


def _sample(record: Record, run: Run, mould: CastMould, fields: NDArray[np.float32]) -> Sample:
    """A simulation as images (8, y, x), with its measures and provenance."""
    area_ratio, width_ratio = shape_ratios(fields[0], mould).tolist()
    return Sample(
        fields=fields,
        depression=mould.depression.astype(np.uint8),
        tethers=mould.tethers.astype(np.uint8),
        parameters=run.parameters,
        simulation=run.simulation,
        seed=run.seed,
        mould=run.mould,
        split=run.split,
        n_cells=len(record.positions),
        converged=record.converged,
        area_ratio=area_ratio,
        width_ratio=width_ratio,
        posts_lost=record.posts_lost,
        alignment=alignment(fields, mould),
        anisotropy=anisotropy(fields),
    )


def _failed(shards: list[Path], runs: Sequence[Run], configuration: str) -> set[int]:
    """Failed simulations."""
    failed = {simulation for path in shards for simulation in read_failures(path, configuration)}
    for split in dict.fromkeys(run.split for run in runs):
        if all(run.simulation in failed for run in runs if run.split == split):
            raise RaptorError(
                f"every simulation of the split '{split}' failed; see the logs of simulate_shard, correct "
                "the campaign, and run the workflow again"
            )
    return failed


def create_stack(file: netCDF4.Dataset, samples: int, pixels: int) -> Callable[[int, Sample], None]:
    """Create a stack's dimensions and variables; returns a function that writes one sample."""
    for name, size in (("sample", samples), ("field", len(FIELDS)), ("y", pixels), ("x", pixels)):
        file.createDimension(name, size)
    variable(file, "field", ("field",), np.array(FIELDS), "name of the field")
    file["field"].comment = "; ".join(f"{name}: {text}" for name, text in LONG_NAMES.items())
    for axis in "yx":
        centres = pixel_centres(pixels)
        variable(file, axis, (axis,), centres, f"pixel centre {axis}, in l0")
    along = ("sample",)
    image, plane = (1, len(FIELDS), pixels, pixels), (1, pixels, pixels)
    # Every netCDF reader has zlib; level 1 reads as fast as any and is 3 % larger than level 4
    # (docs/factory.md). Nothing is rounded, so sums over pixels stay exact.
    packed: dict[str, Any] = {"compression": "zlib", "complevel": 1, "shuffle": True}
    columns = {
        "fields": ("f4", ("sample", "field", "y", "x"), "fields, per pixel", {"chunksizes": image} | packed),
        "depression": ("u1", ("sample", "y", "x"), "1 where cells may lie", {"chunksizes": plane} | packed),
        "tethers": ("u1", ("sample", "y", "x"), "1 where there is a tether", {"chunksizes": plane} | packed),
        **{name: ("f8", along, text, {}) for name, text in PARAMETERS.items()},
        "simulation": ("i4", along, "simulation id", {}),
        "seed": ("i8", along, "seed of the simulation's random stream", {}),
        "mould": (str, along, "mould id", {}),
        "split": (str, along, "train, validation or test", {}),
        "n_cells": ("i4", along, "number of cells", {}),
        "converged": ("i1", along, "1 if the simulation met its solver's tolerance", {}),
        **{
            name: ("i4" if name == "posts_lost" else "f8", along, text, {}) for name, text in MEASURES.items()
        },
    }  # fmt: skip
    for name, (kind, dimensions, long_name, options) in columns.items():
        made = file.createVariable(name, cast(Any, kind), dimensions, **options)
        made.long_name, made.units = long_name, "1"

    def write(row: int, sample: Sample) -> None:
        for name in columns:
            file[name][row] = getattr(sample.parameters if name in PARAMETERS else sample, name)

    return write


@dataclass(frozen=True)
class StackTable:
    """The contents of a stack other than its images, one entry per sample."""

    simulation: NDArray[np.int32]
    mould: list[str]
    split: list[str]
    n_cells: NDArray[np.int32]
    parameters: list[CellParameters]
    pixels: int
    layers: int
    seed: NDArray[np.int64]
    converged: NDArray[np.int8]
    measures: Mapping[str, NDArray[Any]]

    def rows(self, *splits: str) -> list[int]:
        """Samples of some splits, in order."""
        return [row for row, split in enumerate(self.split) if split in splits]

    @property
    def threshold(self) -> float:
        """Density per pixel above which there is tissue."""
        return density_threshold(self.layers, self.pixels)


def read_table(path: Path) -> StackTable:
    """Read the contents of a stack other than its images.

    Raises
    ------
    RaptorError
        If the file is missing or not a stack.
    """
    with open_file(path) as file:
        try:
            columns = [file[name][:] for name in PARAMETERS]
            return StackTable(
                file["simulation"][:],
                [str(v) for v in file["mould"][:]],
                [str(v) for v in file["split"][:]],
                file["n_cells"][:],
                [CellParameters(*(float(v) for v in row)) for row in zip(*columns, strict=True)],
                file.dimensions["x"].size,
                int(file.layers),
                file["seed"][:],
                file["converged"][:],
                {name: np.ma.filled(file[name][:]) for name in MEASURES},
            )
        except (IndexError, KeyError) as error:
            raise RaptorError(f"{path} is not a field stack: {error}") from error


def read_samples(path: Path, rows: Iterable[int]) -> Iterable[Sample]:
    """Read samples one at a time, with one in memory."""
    with open_file(path) as file:
        for row in rows:
            yield Sample(
                file["fields"][row],
                file["depression"][row],
                file["tethers"][row],
                CellParameters(*(float(file[name][row]) for name in PARAMETERS)),
                int(file["simulation"][row]),
                int(file["seed"][row]),
                str(file["mould"][row]),
                str(file["split"][row]),
                int(file["n_cells"][row]),
                bool(file["converged"][row]),
                *(file[name][row].item() for name in MEASURES),
            )


def read_masks(path: Path) -> Iterator[NDArray[np.uint8]]:
    """Depression and tethers (2, y, x) of each sample, one at a time."""
    with open_file(path) as file:
        for row in range(file.dimensions["sample"].size):
            yield np.stack([file["depression"][row], file["tethers"][row]])
