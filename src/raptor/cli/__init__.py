"""The command line: `raptor COMMAND`, one function per command, each with an example in its help."""

import inspect
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

import typer

from raptor.cli.data import check, fetch, progress, reference, same, trace, well
from raptor.cli.design import design
from raptor.cli.designer import designer
from raptor.cli.draw import draw
from raptor.cli.fit import fit
from raptor.cli.library import moulds, tissues
from raptor.cli.measure import measure
from raptor.cli.plot import plot
from raptor.cli.predict import predict
from raptor.cli.rasterise import rasterise
from raptor.cli.simulate import simulate
from raptor.cli.sweep import sweep
from raptor.core.errors import RaptorError

HELP = """Rapid prediction of tissue organisation: CONDOR simulations and their surrogate.

Three steps with your own mould, an SVG, DXF, GeoJSON or picture (docs/moulds.md):

Example:
  raptor draw mould.svg --output mould.png
  raptor simulate mould.svg --tissue glial_1 --output tissue.nc
  raptor predict mould.svg --tissue glial_1 --output prediction.nc
"""
COMMANDS: tuple[Callable[..., Any], ...] = (
    moulds, tissues, draw, rasterise, designer, simulate, predict, plot, sweep, fit, design, measure, check,
    trace, same, progress, well, fetch, reference,
)  # fmt: skip


def _help(text: str) -> str:
    """Help from a docstring: paragraphs are reflowed; an example keeps its lines, as for a shell."""
    paragraphs = inspect.cleandoc(text).split("\n\n")
    for number, paragraph in enumerate(paragraphs):
        if paragraph.startswith("Example:"):
            paragraphs[number] = "\b\n" + paragraph.replace("\n      ", " \\\n      ")  # \b: typer's sign
        else:
            paragraphs[number] = " ".join(paragraph.split())
    return "\n\n".join(paragraphs)


app = typer.Typer(
    help=_help(HELP),
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
for command in COMMANDS:
    app.command(help=_help(command.__doc__ or ""))(command)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line or the given arguments; bad input ends with one sentence and exit status 1.

    One thread, unless OMP_NUM_THREADS says otherwise: networks gain little by a second, and wait for it
    where the processors are shared (docs/surrogate.md).
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # torch, loaded later, reads it
    try:
        app(arguments, prog_name="raptor")
    except RaptorError as error:
        sys.stderr.write(f"error: {error}\n")
        raise SystemExit(1) from None
