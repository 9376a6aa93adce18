"""raptor plot: the picture of a tissue that was simulated or predicted before."""

from pathlib import Path
from typing import Annotated

import typer

import raptor
from raptor.cli import options as opt


def plot(
    result: Annotated[Path, typer.Argument(help="netCDF file from raptor simulate or raptor predict")],
    output: Annotated[Path, typer.Option(help="picture to write (PNG, SVG or PDF)")],
    fields: opt.Fields = False,
) -> None:
    """Draw a tissue from its file, which needs nothing else.

    The picture shows density and the axis of the cells in the mould, tethers that the tissue has let go, and
    the numbers of the tissue; with --fields, the eight fields.

    Example:
      raptor plot tissue.nc --output tissue.pdf
    """
    opt.require_picture_writable(output, result)
    opt.save_picture(raptor.load_fields(result), output, fields=fields)
    typer.echo(f"{output}: {result}")
