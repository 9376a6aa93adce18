"""Commands on data sets: check, trace, same, progress, well, fetch, reference."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer
import yaml

from raptor.cli import options as opt
from raptor.core.errors import RaptorError
from raptor.core.jobs import progress as bar


def progress(
    folder: Annotated[Path, typer.Argument(help="results folder, such as results/paper")],
) -> None:
    """Show how many simulations of a data set are done, at what rate, and the time left.

    Example:
      raptor progress results/paper
    """
    from raptor.dataset.progress import progress_of

    typer.echo(f"{folder}: {progress_of(folder)}")


def well(
    stack: Annotated[Path, typer.Argument(help="fields.nc of a campaign")],
    folder: Annotated[Path, typer.Argument(help="folder to write data/train, data/valid and data/test in")],
) -> None:
    """Write a field stack in the HDF5 layout of The Well, one file per split.

    Example:
      raptor well results/paper/campaigns/paper/fields.nc results/paper/well
    """
    from raptor.dataset.well import write_well

    with bar("copy", None):
        paths = write_well(stack, folder)
    for path in paths:
        typer.echo(path)


def fetch(
    source: Annotated[str, typer.Argument(help="a published folder: its path, or its http or https address")],
    output: Annotated[
        Path | None, typer.Option(help="folder to write in; the source's name in this folder by default")
    ] = None,
) -> None:
    """Bring a published data set here and verify every file; goes on where an earlier call stopped.

    Example:
      raptor fetch https://example.org/raptor/publish --output raptor_data
    """
    from raptor.dataset.fetch import fetch as bring

    folder = output or Path(source.rstrip("/").rsplit("/", 1)[-1] or "raptor_data")
    if folder.is_file():
        raise RaptorError(f"{folder} is a file; choose a folder by --output")
    if folder.resolve() == Path(source).resolve():
        raise RaptorError(f"{folder} is the source itself; choose another folder by --output")
    with bar("fetch", None) as advance:
        count = bring(source, folder, lambda name, files: advance(f"{name}, of {files} files"))
    typer.echo(f"{folder}: {count} files, every checksum right")


def check(
    path: Annotated[Path, typer.Argument(help="results folder, campaign, shard, field stack or mould")],
    scale: opt.Scale = None,
    mm_per_l0: opt.MmPerL0 = None,
    page: opt.Page = None,
    part: Annotated[
        float,
        typer.Option(min=0, max=1, help="random share of a folder's simulations to recompute"),
    ] = 1.0,
) -> None:
    """Check a data set, a shard, a field stack or a mould against its rules; list every fault.

    Example:
      raptor check results/laptop --part 0.1
      raptor check mould.svg
    """
    from raptor.dataset.check import check as find_faults
    from raptor.moulds import read_mould

    if not path.exists():
        raise RaptorError(f"{path} does not exist; check the path")
    read = partial(read_mould, scale=scale, mm_per_l0=mm_per_l0, page=page)
    with bar("check", None) as advance:
        faults = find_faults(path, part, read, advance)
    for fault in faults:
        typer.echo(fault)
    typer.echo(f"{path}: {len(faults)} faults" if faults else f"{path}: no faults")
    raise typer.Exit(1 if faults else 0)


def trace(
    folder: Annotated[Path, typer.Argument(help="folder of a campaign")],
    simulation: Annotated[int | None, typer.Option(help="simulation id")] = None,
    example: Annotated[int | None, typer.Option(help="row of examples.csv, from 0")] = None,
) -> None:
    """Show the provenance of a sample: mould, parameters, seed, solver, package and model version.

    Example:
      raptor trace results/laptop/campaigns/paper --simulation 7
    """
    from raptor.dataset.provenance import trace_example, trace_simulation

    if (simulation is None) == (example is None):
        raise RaptorError("give one of --simulation and --example")
    if simulation is not None:
        found = trace_simulation(folder, simulation)
    else:
        assert example is not None
        found = trace_example(folder, example)
    typer.echo(yaml.safe_dump(found, sort_keys=False).rstrip())


def same(
    first: Annotated[Path, typer.Argument(help="results folder, or folder of a campaign")],
    second: Annotated[Path, typer.Argument(help="another one")],
) -> None:
    """Compare two results folders, or two campaigns, bit by bit, apart from times.

    Example:
      raptor same results/laptop results/again
    """
    from raptor.dataset.compare import differences

    with bar("comparison", None):
        found = differences(first, second)
    for difference in found:
        typer.echo(difference)
    typer.echo("not the same data" if found else "the same data")
    raise typer.Exit(1 if found else 0)


def reference(
    root: Annotated[Path, typer.Argument(help="the project's folder")] = Path(),
) -> None:
    """Write the files generated from the configuration model: JSON schema, defaults and key table.

    Example:
      raptor reference .
    """
    from raptor.config.reference import write_reference

    for path in write_reference(root):
        typer.echo(path)
