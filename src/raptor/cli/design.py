"""raptor design: search for moulds whose tissues do what is wanted."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

import raptor
from raptor.cli import options as opt
from raptor.core.jobs import progress


def design(
    spec: Annotated[Path, typer.Argument(help="what is wanted: a YAML file (docs/design.md)")],
    output: Annotated[Path, typer.Option(help="folder to write the designs to")],
    model: opt.Surrogate = None,
    evaluations: Annotated[int | None, typer.Option(help="moulds to predict, instead of the file's")] = None,
    simulations: Annotated[
        int | None, typer.Option(help="simulations of each finalist, instead of the file's")
    ] = None,
    accuracy: Annotated[str | None, typer.Option(help="of the simulations, instead of the file's")] = None,
    seed: Annotated[int | None, typer.Option(help="of the search, instead of the file's")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="do not print each generation")] = False,
) -> None:
    """Search for moulds of the families whose tissues do what a file asks for, and simulate the best.

    Thousands of moulds are predicted; the finalists are simulated and ranked by that. The folder gets tables
    (designs.csv, front.csv, progress.csv), figures, and each mould as GeoJSON, SVG and DXF.

    Example:
      raptor design glial.yaml --output glial
      raptor design glial.yaml --output quick --evaluations 1500 --accuracy draft
    """
    from raptor.optimisation.command import design as found_by
    from raptor.optimisation.spec import read_spec, with_changes

    search = {"evaluations": evaluations, "seed": seed}
    changes = {"simulations": simulations, "accuracy": accuracy}
    wanted = with_changes(read_spec(spec), changes, search)
    if output.exists() and not output.is_dir():
        raise raptor.RaptorError(f"{output} is a file; give the name of a folder")
    opt.require_writable(output / "designs.csv" if output.is_dir() else output, kind="a folder")
    with progress("design", wanted.steps) as advance:

        def report(note: str) -> None:
            advance(note)
            if not quiet:
                typer.echo(note, err=True)

        found = found_by(wanted, model, report)
    found.save(output)
    from raptor.plotting import designs_figure, front_figure, save

    save(front_figure(found), output / "front")
    save(designs_figure(found), output / "moulds_found")
    typer.echo(f"{output}: {found}")
    best = output / "moulds" / f"{found.best}.geojson"
    cells = " ".join(f"--{name.replace('_', '-')} {v:g}" for name, v in asdict(wanted.parameters).items())
    typer.echo(f"next: raptor simulate {opt.quote(best)} {cells} --output tissue.nc", err=True)
