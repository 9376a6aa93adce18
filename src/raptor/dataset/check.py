"""`raptor check`: the rules that every file of a data set must satisfy (docs/data.md).

Each check yields faults, one sentence each.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from raptor.condor.energy import cell_tension, objective
from raptor.condor.network import build_network
from raptor.condor.walls import NO_WALLS
from raptor.core.errors import RaptorError
from raptor.core.files import read_json
from raptor.dataset.design import Run, read_design
from raptor.dataset.examples import mould_images, read_examples, training_scaling
from raptor.dataset.netcdf import open_file
from raptor.dataset.publish import MANIFEST, check_manifest
from raptor.dataset.result import CELLS
from raptor.dataset.scaling import read_scaling
from raptor.dataset.shards import Record, Shard, campaign_folders, read_shard
from raptor.dataset.stack import Sample, read_masks, read_samples, read_table, record_fields
from raptor.fields.directors import alignment, anisotropy
from raptor.fields.labelled import MEASURES
from raptor.fields.shape import shape_ratios
from raptor.fields.tethers import contact, held, posts_lost
from raptor.frame import pixel_size
from raptor.moulds.cast import CastMould, cast_sites
from raptor.moulds.geojson import moulds_by_id, read_features, read_moulds
from raptor.moulds.geometry import Mould
from raptor.moulds.reading import SUFFIXES, read_mould
from raptor.raster import DEEP
from raptor.symmetry import FIELDS

RELATIVE = 1e-4  # of recomputed values: storage is float32
UNDEFINED = ("area_ratio", "width_ratio", "held", "alignment", "anisotropy")  # if there is nothing to measure
WALL_YIELD = 0.1  # l0; depth to which a soft wall yields


def check(
    path: Path,
    fraction: float = 1.0,
    read: Callable[[Path], Mould] = read_mould,
    on_progress: Callable[[str], None] = lambda part: None,
) -> list[str]:
    """Check a results folder, a campaign's folder, or a file: shard, stack, prediction, table, moulds.

    A file of one mould, of any format, is read by `read`.
    Energy, tension and fields of a folder are recomputed for a random `fraction` of its simulations; the
    parts of a folder are told to `on_progress` as they begin.

    Returns
    -------
    list of str
        One sentence per fault; empty if there is none.

    Raises
    ------
    RaptorError
        If there is nothing at the path that can be checked.
    """
    path = Path(path)
    if path.is_dir():
        return list(_check_folder(path, fraction, on_progress))
    if path.suffix.lower() in SUFFIXES and path.suffix != ".json":
        return _fault_of(lambda path: _cast_moulds(path, read), path)
    if path.suffix == ".csv":
        return _fault_of(read_examples if path.name == "examples.csv" else read_design, path)
    if path.suffix == ".json":
        return _fault_of(read_scaling, path)
    with open_file(path) as file:
        names = set(file.variables)
    if "row_size" in names:
        return list(check_shard(path))
    if {"fields", "n_cells"} <= names:
        return list(check_stack(path))
    if set(FIELDS) <= names:
        return list(check_result(path))
    raise RaptorError(f"{path} is neither a shard nor fields; nothing to check")


def _cast_moulds(path: Path, read: Callable[[Path], Mould]) -> None:
    """Read a file's moulds, and cast two layers of each to find moulds without cells."""
    is_table = path.suffix.lower() == ".geojson" and len(read_features(path)) > 1
    is_table = is_table and all("mould" in (each.get("properties") or {}) for each in read_features(path))
    for mould in read_moulds(path) if is_table else [read(path)]:
        cast_sites(mould, layers=2)


def _fault_of(read: Callable[[Path], object], path: Path) -> list[str]:
    """Faults found in reading a file."""
    try:
        read(path)
    except RaptorError as error:
        return [str(error)]
    return []


def _check_folder(folder: Path, fraction: float, on_progress: Callable[[str], None]) -> Iterator[str]:
    """Every campaign of a results folder, or the one campaign of its own folder."""
    campaigns = campaign_folders(folder)
    if (folder / MANIFEST).is_file():
        on_progress("checksums")
        yield from check_manifest(folder)
    for name, path in campaigns.items():
        on_progress(name)
        yield from (f"{name}: {fault}" for fault in check_campaign(path, fraction))
    stacks = {name: path / "fields.nc" for name, path in campaigns.items()}
    if len(stacks) > 1:
        on_progress("splits of all campaigns")
        yield from check_splits({name: path for name, path in stacks.items() if path.is_file()})
    for path in sorted(folder.glob("surrogate/*/normalisation.json")):
        yield from _check_scaling(path, stacks)


def check_campaign(folder: Path, fraction: float = 1.0) -> Iterator[str]:
    """All files of a campaign's folder, against the rules and each other.

    Raises
    ------
    RaptorError
        If the design, the moulds or the stack are missing.
    """
    stack = folder / "fields.nc"
    runs, moulds = read_design(folder / "design.csv"), moulds_by_id(folder / "moulds.geojson")
    yield from check_design(runs, moulds)
    yield from check_stack(stack)
    with open_file(stack) as file:
        names = str(getattr(file, "shards", "")).split()
    shards = [folder / "shards" / name for name in names]
    ids = np.array([run.simulation for run in runs])
    chosen = np.random.default_rng().permutation(ids)[: max(1, round(fraction * len(ids)))]
    yield from check_against_shards(stack, shards, runs, moulds, {int(i) for i in chosen})
    yield from check_examples(folder / "examples.csv", stack)


def check_design(runs: list[Run], moulds: dict[str, Mould]) -> Iterator[str]:
    """Ids and seeds are unique; every mould exists and has one split."""
    for what, values in (
        ("simulation id", [str(run.simulation) for run in runs]),
        ("seed", [str(run.seed) for run in runs]),
    ):
        if len(set(values)) < len(values):
            twice = next(v for v in values if values.count(v) > 1)
            yield f"design.csv: {what} {twice} stands in two rows"
    splits: dict[str, str] = {}
    for run in runs:
        if run.mould not in moulds:
            yield f"design.csv: mould {run.mould} of simulation {run.simulation} is not in moulds.geojson"
        if splits.setdefault(run.mould, run.split) != run.split:
            yield f"design.csv: mould {run.mould} stands in two splits ({splits[run.mould]}, {run.split})"


def check_splits(stacks: Mapping[str, Path]) -> Iterator[str]:
    """No mould, in any of its eight images, is in two splits, within or between the stacks.

    Stacks by campaign.
    """
    first_seen: dict[bytes, tuple[str, str]] = {}  # hashes, because masks would fill the memory
    for campaign, path in stacks.items():
        table = read_table(path)
        for mould, split, masks in zip(table.mould, table.split, read_masks(path), strict=True):
            here = f"{campaign}: {mould}"
            for image in mould_images(masks):
                there, other = first_seen.setdefault(image, (here, split))
                if other != split:
                    yield (
                        f"{here} ({split}) is the mould of {there} ({other}), up to rotation and reflection: "
                        "one mould in two splits"
                    )
                    break


def check_result(path: Path) -> Iterator[str]:
    """The file of one tissue: its fields and masks, and its cells if simulated."""
    with open_file(path) as file:
        yield from _check_variables(file, Path(path).name)
        fields = np.stack([file[name][:] for name in FIELDS])
        depression, tethers = file["depression"][:], file["tethers"][:]
        n_cells, simulated = int(file.n_cells), CELLS in file.groups
    yield from _check_fields(fields, depression, tethers, n_cells, Path(path).name)
    if simulated:
        yield from check_shard(path, group=CELLS)


def check_shard(path: Path, chosen: set[int] | None = None, group: str | None = None) -> Iterator[str]:
    """Stored energy and tension equal those recomputed from positions and orientations.

    Of the `chosen` simulations, or of all; of a file, or of the group of one.
    """
    try:
        shard = read_shard(path, group=group)
        with open_file(path, group) as file:
            yield from _check_variables(file, Path(path).name)
    except RaptorError as error:
        yield str(error)
        return
    for record in shard.records:
        if chosen is None or record.simulation in chosen:
            yield from _check_record(record, shard, Path(path).name)


def _check_record(record: Record, shard: Shard, file: str) -> Iterator[str]:
    where = f"{file}: simulation {record.simulation}"
    arrays = ("sites", "positions", "orientation", "tension")
    broken = [name for name in arrays if not np.isfinite(getattr(record, name)).all()]
    if broken or not np.isfinite(record.energy):
        yield f"{where}: NaN or infinity in {', '.join(broken) or 'energy'}"
        return
    if np.abs(np.linalg.norm(record.orientation, axis=1) - 1).max() > RELATIVE:
        yield f"{where}: an orientation is not a unit vector"
        return
    lattice = record.lattice(shard.model)
    delta = record.parameters.delta
    energy = objective(record.state, build_network(lattice), NO_WALLS, delta)[0]
    if abs(energy - record.energy) > RELATIVE * abs(energy) + 1e-9 * lattice.bonds:
        yield f"{where}: energy is {record.energy:.6g}, recomputed {energy:.6g}"
    tension = cell_tension(record.state, lattice, delta, shard.model.tension)
    worst = np.abs(tension - record.tension).max()
    if worst > RELATIVE * np.abs(tension).max() + 1e-5:
        yield f"{where}: tension differs from the recomputed one by up to {worst:.3g}"


def check_stack(path: Path) -> Iterator[str]:
    """Invariants of fields and masks; no mould, in any of its eight images, is in two splits."""
    with open_file(path) as file:
        yield from _check_variables(file, Path(path).name, images=False)
        yield from _check_field_names(file, Path(path).name)
    for sample in read_samples(path, range(len(read_table(path).split))):
        where = f"{Path(path).name}: simulation {sample.simulation}"
        yield from _check_fields(sample.fields, sample.depression, sample.tethers, sample.n_cells, where)
    yield from check_splits({Path(path).name: path})


def _check_field_names(file: Any, name: str) -> Iterator[str]:
    if [str(v) for v in file["field"][:]] != list(FIELDS):
        yield f"{name}: the fields are not {', '.join(FIELDS)} in this order"


def _check_variables(file: Any, name: str, *, images: bool = True) -> Iterator[str]:
    """Attributes of the file and its variables; every number is finite.

    Without `images` the stack's large variables are skipped; the check of each sample covers them.
    """
    for attribute in ("title", "source", "history", "references", "configuration"):
        if not hasattr(file, attribute):
            yield f"{name}: attribute {attribute} is missing"
    for variable in file.variables.values():
        if not (hasattr(variable, "long_name") and hasattr(variable, "units")):
            yield f"{name}: variable {variable.name} lacks long_name or units"
        if variable.dtype is not str and (images or variable.ndim < 3):
            values = variable[:]
            # No material on the central section; tethers at the outline; cells too sparse or all upright.
            if variable.name not in UNDEFINED and not np.isfinite(values).all():
                yield f"{name}: NaN or infinity in {variable.name}"


def _check_fields(
    stack: NDArray[Any], depression: NDArray[Any], tethers: NDArray[Any], n_cells: int, where: str
) -> Iterator[str]:
    """Invariants of one tissue's fields (8, y, x) in its masks (y, x)."""
    fields = {name: field.astype(np.float64) for name, field in zip(FIELDS, stack, strict=True)}
    for name, field in fields.items():
        if not np.isfinite(field).all():
            yield f"{where}: NaN or infinity in {name}"
            return
    density = fields["density"]
    small = 1e-5 * density.max() + 1e-12
    trace = fields["sxsx"] + fields["sysy"] + fields["szsz"]
    if np.abs(trace - density).max() > small:
        yield f"{where}: sxsx + sysy + szsz is not density (off by {np.abs(trace - density).max():.3g})"
    if abs(density.sum() / n_cells - 1) > 1e-3:
        yield f"{where}: density sums to {density.sum():.6g}, the tissue has {n_cells} cells"
    if density.min() < 0:
        yield f"{where}: density is negative ({density.min():.3g})"
    for a, b in (("x", "y"), ("x", "z"), ("y", "z")):
        product = fields[f"s{a}s{a}"] * fields[f"s{b}s{b}"]
        if (np.abs(fields[f"s{a}s{b}"]) > np.sqrt(np.maximum(product, 0)) + small).any():
            yield f"{where}: |s{a}s{b}| exceeds sqrt(s{a}s{a} s{b}s{b}): orientation tensor not positive"
    if (depression & tethers).any():
        yield f"{where}: depression and tethers overlap"
    away = distance_transform_edt(depression == 0) * pixel_size(density.shape[-1])
    deep = away > DEEP + WALL_YIELD + pixel_size(density.shape[-1])
    if (density[deep] > small).any():
        yield f"{where}: density of {density[deep].max():.3g} deep in a tether or outside the depression"


def check_against_shards(
    stack: Path, shards: list[Path], runs: list[Run], moulds: dict[str, Mould], chosen: set[int]
) -> Iterator[str]:
    """Fields, masks and parameters of a stack agree with its simulations.

    Every simulation is looked up; those `chosen` are recomputed.
    """
    table = read_table(stack)
    rows = {int(simulation): row for row, simulation in enumerate(table.simulation)}
    by_id = {run.simulation: run for run in runs}
    with open_file(stack) as file:
        stated = {int(simulation) for simulation in str(getattr(file, "missing", "")).split()}
    for missing in sorted(set(by_id) ^ set(rows) ^ stated):
        yield f"simulation {missing} is in only one of design.csv and {Path(stack).name}"
    uncovered = set(rows)
    for path in shards:
        yield from check_shard(path, chosen)
        try:
            shard = read_shard(path)
        except RaptorError:
            continue  # reported by check_shard
        for record in shard.records:
            uncovered.discard(record.simulation)
            run = by_id.get(record.simulation)
            if record.simulation not in rows or run is None or run.mould not in moulds:
                yield f"{path.name}: simulation {record.simulation} or its mould is not in the design"
                continue
            if record.simulation not in chosen:
                continue
            (sample,) = read_samples(stack, [rows[record.simulation]])
            yield from _compare(sample, record, run, moulds[run.mould], shard.model.layers)
    for simulation in sorted(uncovered):
        yield f"simulation {simulation} of {Path(stack).name} is in no readable shard"


def _compare(sample: Sample, record: Record, run: Run, mould: Mould, layers: int) -> Iterator[str]:
    where = f"simulation {sample.simulation}"
    stored = (sample.mould, sample.split, sample.n_cells, sample.parameters)
    if stored != (run.mould, run.split, len(record.positions), run.parameters) or (
        record.parameters != run.parameters or record.seed != run.seed
    ):
        yield f"{where}: mould, split, cells, seed or parameters differ between design, shard and stack"
    cast = CastMould(mould, layers, sample.fields.shape[-1])
    if (cast.depression != sample.depression).any() or (cast.tethers != sample.tethers).any():
        yield f"{where}: its masks do not agree with mould {run.mould}"
    fields = record_fields(record, sample.fields.shape[-1])
    measured = (
        *shape_ratios(sample.fields[0], cast), posts_lost(held(record.positions, cast)),
        alignment(sample.fields, cast), anisotropy(sample.fields),
    )  # fmt: skip
    for name, value in zip(MEASURES, measured, strict=True):
        if not np.isclose(value, getattr(sample, name), equal_nan=True):
            yield f"{where}: {name} is {getattr(sample, name):.6g}, recomputed {value:.6g}"
    if not np.allclose(contact(record.positions, cast), record.contact, atol=0.05):
        yield f"{where}: contact does not agree with the positions in the shard"
    for name, stored_field, field in zip(FIELDS, sample.fields, fields, strict=True):
        if np.abs(stored_field - field).max() <= RELATIVE * np.abs(field).max():
            continue
        if np.abs(stored_field + field).max() <= RELATIVE * np.abs(field).max():
            yield f"{where}: {name} has the opposite sign of the field recomputed from the shard"
        else:
            yield f"{where}: {name} differs from the field recomputed from the shard"


def check_examples(path: Path, stack: Path) -> Iterator[str]:
    """Examples exist, are listed once, and are not from test samples."""
    split = read_table(stack).split
    try:
        examples = read_examples(path)
    except RaptorError as error:
        yield str(error)
        return
    if len(set(examples)) < len(examples):
        yield "examples.csv: an example is listed twice"
    for example in examples:
        if not (0 <= example.sample < len(split) and 0 <= example.element < 8):
            yield f"examples.csv: {example} is not in {Path(stack).name}"
        elif split[example.sample] == "test":
            yield f"examples.csv: sample {example.sample} is held out for test"


def _check_scaling(path: Path, stacks: Mapping[str, Path]) -> Iterator[str]:
    """The constants agree with the training splits that they name."""
    where = f"{path.parent.name}/{path.name}"
    try:
        content, scaling = read_json(path), read_scaling(path)
        named, fraction = content["campaigns"], content["training_fraction"]
        wanted = training_scaling(*(stacks[campaign] for campaign in named), fraction=fraction)
    except (KeyError, ValueError, RaptorError) as error:
        yield f"{where}: {error}"
        return
    for ours, theirs in ((scaling.offset, wanted.offset), (scaling.scale, wanted.scale)):
        if not np.allclose(ours, theirs, rtol=1e-6, equal_nan=True):
            yield f"{where}: the constants do not agree with the training split of {', '.join(named)}"
