"""Shared by several commands: arguments, parameters by flag or by tissue, and output."""

import json
import os
import shlex
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import raptor
from raptor.core.files import plain
from raptor.core.jobs import progress
from raptor.parameters import LAYERS

if TYPE_CHECKING:
    from raptor.dataset.result import Result

Mould = Annotated[
    Path,
    typer.Argument(help="library mould by name, or an SVG, DXF, GeoJSON or picture file"),
]
Scale = Annotated[
    float | None,
    typer.Option(
        help="l0 per unit of the mould's file (user unit, coordinate, pixel); without it a drawing is fitted "
        "to the frame: its longest side becomes 52 l0"
    ),
]
MmPerL0 = Annotated[
    float | None,
    typer.Option(help="millimetres per l0; with a drawing in a real unit (mm, cm, in, pt) it sets the scale"),
]
Page = Annotated[int | None, typer.Option(help="page, slice or time point of a picture that has several")]
Delta = Annotated[float | None, typer.Option(help="cell-matrix interaction, 0 to 1")]
KappaNNN = Annotated[
    float | None, typer.Option("--kappa-nnn", help="second-shell spring constant, in kappa0")
]
KappaNNNN = Annotated[
    float | None, typer.Option("--kappa-nnnn", help="third-shell spring constant, in kappa0")
]
Tissue = Annotated[
    str | None,
    typer.Option(
        help="use the paper's fitted parameters of this tissue, such as glial_1; flags override them"
    ),
]
Tissues = Annotated[Path | None, typer.Option(help="file of tissues, instead of the library's")]
Surrogate = Annotated[
    Path | None,
    typer.Option(help="folder with weights.safetensors and model.json, instead of the shipped surrogate"),
]
Output = Annotated[Path, typer.Option(help="netCDF file to write")]
Picture = Annotated[Path | None, typer.Option(help="picture of the tissue to write (PNG, SVG or PDF)")]
Fields = Annotated[bool, typer.Option("--fields", help="draw the eight fields in the picture")]
Json = Annotated[bool, typer.Option("--json", help="print JSON, for scripts")]
Layers = Annotated[int, typer.Option(help="cell layers between floor and fill height")]


def read_mould(
    mould: Path, scale: float | None, mm_per_l0: float | None, page: int | None, layers: int | None = None
) -> "raptor.Mould":
    """Read a mould; print its scale and size in millimetres on standard error."""
    shape = raptor.read_mould(mould, scale, mm_per_l0, page)
    said = [shape.note, shape.in_millimetres(layers)]
    if any(said):
        typer.echo(f"{mould}: {'; '.join(filter(None, said))}", err=True)
    return shape


def cell_parameters(
    delta: float | None,
    kappa_nnn: float | None,
    kappa_nnnn: float | None,
    tissue: str | None = None,
    tissues: Path | None = None,
) -> "raptor.CellParameters":
    """Parameters from flags; missing ones from the fit of a tissue.

    Raises
    ------
    RaptorError
        If one is given neither way, the tissue is unknown, or a value is out of bounds.
    """
    names = [field.name for field in fields(raptor.CellParameters)]
    values = zip(names, (delta, kappa_nnn, kappa_nnnn), strict=True)
    given = {name: value for name, value in values if value is not None}
    if tissue is not None:
        return raptor.tissue(tissue, tissues).parameters(tissue, given)
    missing = [f"--{name.replace('_', '-')}" for name in names if name not in given]
    if missing:
        raise raptor.RaptorError(f"parameters are missing: give {', '.join(missing)}, or --tissue NAME")
    return raptor.CellParameters(**given)


def require_writable(output: Path, *others: Path | None, kind: str = "a netCDF file") -> None:
    """Check before the work that a result can be written.

    Parameters
    ----------
    others : sequence of Path or None
        Other files that the command reads or writes, which the result must not overwrite.

    Raises
    ------
    RaptorError
        If the path is a folder or another file of the command, or its folder does not exist or may
        not be written.
    """
    if output.is_dir():
        raise raptor.RaptorError(f"{output} is a folder; give the name of {kind}")
    folder = output.parent
    if not folder.is_dir():
        raise raptor.RaptorError(f"folder {folder} does not exist; create it or choose another output")
    if not os.access(folder, os.W_OK):
        raise raptor.RaptorError(f"folder {folder.resolve()} may not be written; choose another output")
    if any(other is not None and output.resolve() == other.resolve() for other in others):
        raise raptor.RaptorError(
            f"{output} is another file of this command too; choose another name for {kind}"
        )


def require_picture_writable(picture: Path | None, *others: Path | None) -> None:
    """As `require_writable`, for an optional picture, whose suffix must be that of a picture."""
    if picture is not None:
        from raptor.plotting import require_picture

        require_picture(picture)
        require_writable(picture, *others, kind="a picture")


def save_picture(what: Any, picture: Path | None, **options: Any) -> None:
    """Write what `raptor.plot` draws, if a picture is requested."""
    if picture is not None:
        from raptor.plotting import save_picture

        save_picture(raptor.plot(what, **options), picture)


def measured(
    photograph: Path, mould: "raptor.Mould", overlay: Path | None, **options: Any
) -> "raptor.MeasuredPhotograph":
    """Measure a photograph and write its overlay, which shows a refused one too."""
    try:
        with progress("measurement", None):
            found = raptor.measure(photograph, mould, **options)
    except raptor.MeasurementError as refused:
        save_picture(refused, overlay)
        seen = f"see {overlay}" if overlay is not None else "--overlay FILE.png shows how far it came"
        raise raptor.RaptorError(f"{photograph}: {refused} ({seen})") from refused
    save_picture(found, overlay)
    return found


def finish(
    result: "Result", output: Path, picture: Path | None, fields: bool, as_json: bool, then: str = ""
) -> None:
    """Write a tissue or a prediction and its picture, and print a summary and the next command."""
    raptor.save(result, output)
    save_picture(result, picture, fields=fields)
    numbers = result.numbers | {"mm_per_l0": result.mould.mm_per_l0, "output": output, "picture": picture}
    if not then and picture is None:
        then = f"raptor plot {quote(output)} --output {quote(output.with_suffix('.png'))}"
    report(f"{output}: {result}", numbers, as_json, then)


def report(sentence: str, numbers: Mapping[str, Any], as_json: bool, then: str = "") -> None:
    """Print a result: a sentence, or its numbers as one JSON object with NaN and infinity as null.

    After a sentence, the next command, on standard error: what a user would do then.
    """
    if not as_json:
        typer.echo(sentence)
        if then:
            typer.echo(f"next: {then}", err=True)
        return
    typer.echo(json.dumps(plain(numbers), indent=1))


def quote(path: object) -> str:
    """A path as a shell reads it."""
    return shlex.quote(str(path))


def words(
    mould: Path, scale: float | None, mm_per_l0: float | None, page: int | None, layers: int = LAYERS
) -> str:
    """A mould as it was given on the command line, and layers if not the usual, for the next command."""
    given = {"--scale": scale, "--mm-per-l0": mm_per_l0, "--page": page}
    given |= {"--layers": layers if layers != LAYERS else None}
    flags = (f"{flag} {value:g}" for flag, value in given.items() if value is not None)
    return " ".join([quote(mould), *flags])
