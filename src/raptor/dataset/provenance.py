"""Provenance of a sample: from an image back to mould, parameters, seed, solver and versions."""

from pathlib import Path
from typing import Any

from raptor.core.errors import RaptorError
from raptor.dataset.design import read_design
from raptor.dataset.examples import read_examples
from raptor.dataset.netcdf import open_file
from raptor.dataset.shards import RESULTS, read_failures, shard_paths
from raptor.dataset.stack import read_table
from raptor.fields.labelled import LONG_NAMES
from raptor.frame import pixel_size
from raptor.moulds.geojson import moulds_by_id
from raptor.parameters import PARAMETERS
from raptor.raster import SIGMA
from raptor.symmetry import Element

MADE_BY = (
    "source", "model_version", "solver", "accuracy", "device", "layers", "shells", "tension", "configuration",
)  # fmt: skip
"""Attributes that record how a file was made."""


def trace_example(folder: Path, example: int) -> dict[str, Any]:
    """Provenance of a row of examples.csv: its element of D4 and its simulation.

    Raises
    ------
    RaptorError
        If there is no such row, or a file on the way is missing.
    """
    examples = read_examples(folder / "examples.csv")
    if not 0 <= example < len(examples):
        raise RaptorError(f"{folder} has examples 0 to {len(examples) - 1}; example {example} is not there")
    chosen = examples[example]
    table = read_table(folder / "fields.nc")
    matrix = Element.from_index(chosen.element).matrix
    image = {"element": chosen.element, "matrix": matrix.astype(int).tolist()}
    simulation = int(table.simulation[chosen.sample])
    return {"example": example, "image under D4": image, **trace_simulation(folder, simulation)}


def trace_simulation(folder: Path, simulation: int) -> dict[str, Any]:
    """Provenance of a simulation's fields, as plain values; files relative to the campaign's folder.

    Raises
    ------
    RaptorError
        If the design does not have the simulation, or a file on the way is missing.
    """
    folder = Path(folder)
    runs = {run.simulation: run for run in read_design(folder / "design.csv")}
    if simulation not in runs:
        raise RaptorError(f"{folder} has simulations {min(runs)} to {max(runs)}, not {simulation}")
    run = runs[simulation]
    mould = moulds_by_id(folder / "moulds.geojson", {run.mould})[run.mould]
    return {
        "simulation": simulation,
        "split": run.split,
        "mould": {"id": run.mould, "file": "moulds.geojson", **_describe(mould.as_feature())},
        "parameters": {name: getattr(run.parameters, name) for name in PARAMETERS},
        "seed": run.seed,
        **run.own,
        **_trace_shard(folder, simulation),
        **_trace_stack(folder, simulation),
    }


def _describe(feature: dict[str, Any]) -> dict[str, Any]:
    """Sizes of a mould, without its corners."""
    given = feature["properties"]
    return {"symmetry": given["symmetry"], "area": given["area"], "tethers": len(given["tethers"])}


def _trace_shard(folder: Path, simulation: int) -> dict[str, Any]:
    """The shard that holds a simulation, how it was made, and how the simulation ended."""
    for path in shard_paths(folder):
        place = f"shards/{path.name}"
        failures = read_failures(path)
        if simulation in failures:
            return {"shard": place, "failed": failures[simulation]}
        with open_file(path) as file:
            rows = [row for row, number in enumerate(file["simulation"][:]) if number == simulation]
            if rows:
                ended = {name: file[name][rows[0]].item() for name in (*RESULTS, "wall_time")}
                return {"shard": place, "made by": _made_by(file), "ended with": ended}
    raise RaptorError(f"no shard of {folder} holds simulation {simulation}; run the workflow again")


def _trace_stack(folder: Path, simulation: int) -> dict[str, Any]:
    """The row of the stack, and how its fields were made from cells."""
    path = folder / "fields.nc"
    rows = [row for row, number in enumerate(read_table(path).simulation) if number == simulation]
    if not rows:
        return {}
    with open_file(path) as file:
        pixels = file.dimensions["x"].size
        raster = {"pixels": pixels, "pixel_size": pixel_size(pixels), "sigma": SIGMA}
        made = {"file": "fields.nc", "sample": rows[0], "source": str(file.source)}
        return {"fields": {**made, "raster": raster, "meaning": dict(LONG_NAMES)}}


def _made_by(file: Any) -> dict[str, Any]:
    """Attributes as plain values."""
    found = {name: getattr(file, name) for name in MADE_BY if name in file.ncattrs()}
    return {name: value if isinstance(value, str) else value.tolist() for name, value in found.items()}
