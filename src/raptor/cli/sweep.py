"""raptor sweep: the curve of a mould over parameters, predicted and simulated."""

from itertools import product
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import raptor
from raptor.cli import options as opt
from raptor.core.files import atomic_path
from raptor.core.jobs import progress

RANGE = "one value, or START:STOP:COUNT"
Values = Annotated[str, typer.Option(help=f"cell-matrix interaction: {RANGE}")]


def sweep(
    mould: opt.Mould,
    output: Annotated[Path, typer.Option(help="CSV table to write")],
    delta: Values = "0.1:0.9:9",
    kappa_nnn: Annotated[
        str, typer.Option("--kappa-nnn", help=f"second-shell spring constant, in kappa0: {RANGE}")
    ] = "0.5",
    kappa_nnnn: Annotated[
        str, typer.Option("--kappa-nnnn", help=f"third-shell spring constant, in kappa0: {RANGE}")
    ] = "0.25",
    simulate: Annotated[int, typer.Option(min=0, help="simulations of each point, besides")] = 0,
    model: opt.Surrogate = None,
    scale: opt.Scale = None,
    mm_per_l0: opt.MmPerL0 = None,
    page: opt.Page = None,
    accuracy: Annotated[str, typer.Option(help="of the simulations")] = "standard",
    seed: Annotated[int, typer.Option(min=0, max=2**31 - 1, help="of the first simulation")] = 0,
    picture: Annotated[Path | None, typer.Option(help="picture of the curve (PNG, SVG or PDF)")] = None,
) -> None:
    """Show how the tissue of a mould changes with the parameters of cells and matrix.

    The table has A/A0, w/w0, alignment and tethers lost at each combination of the values, predicted with
    95 % bands and, with --simulate, as the mean of so many simulations.

    Example:
      raptor sweep mould.svg --delta 0.1:0.9:9 --output curve.csv --picture curve.png
      raptor sweep mould.svg --delta 0.3 --kappa-nnn 0.1:0.7:4 --simulate 2
          --output curve.csv
    """
    given = {"--delta": delta, "--kappa-nnn": kappa_nnn, "--kappa-nnnn": kappa_nnnn}
    values = [_values(option, text) for option, text in given.items()]
    cells = [raptor.CellParameters(*point) for point in product(*values)]
    shape = opt.read_mould(mould, scale, mm_per_l0, page)
    opt.require_writable(output, mould, kind="a CSV table")
    opt.require_picture_writable(picture, mould, output)
    with progress("sweep", len(cells)) as advance:
        table = raptor.sweep(
            shape, cells, simulations=simulate, surrogate=model, accuracy=accuracy, seed=seed,
            on_progress=advance,
        )  # fmt: skip
    with atomic_path(output) as temporary:
        table.to_csv(temporary, index=False)
    if picture is not None:
        from raptor.plotting import curve_figure, save_picture

        save_picture(curve_figure(table, shape.name), picture)
    unusual = int((table["unusual"] != "").sum())
    said = f"; {unusual} unlike the training set, see its column 'unusual'" if unusual else ""
    changed = {
        "--model": model,
        "--accuracy": accuracy if accuracy != "standard" else None,
        "--seed": seed or None,
    }
    given |= {option: opt.quote(value) for option, value in changed.items() if value is not None}
    then = "" if simulate else _then(given, opt.words(mould, scale, mm_per_l0, page), output, picture)
    opt.report(f"{output}: {len(table)} points{said}", {}, False, then)


def _then(given: dict[str, str], mould: str, output: Path, picture: Path | None) -> str:
    """The next command: the same points, simulated too, and a picture."""
    points = " ".join(f"{option} {value}" for option, value in given.items())
    drawn = opt.quote(picture or output.with_suffix(".png"))
    return f"raptor sweep {mould} {points} --simulate 2 --output {opt.quote(output)} --picture {drawn}"


def _values(option: str, text: str) -> list[float]:
    """The values of an option: one number, or a number of them from the first to the last."""
    parts = text.split(":")
    try:
        if len(parts) == 1:
            return [float(text)]
        start, stop, count = float(parts[0]), float(parts[1]), int(parts[2])
        if len(parts) == 3 and 2 <= count <= 1000:
            return [round(float(value), 12) for value in np.linspace(start, stop, count)]
    except (ValueError, IndexError):
        pass
    raise raptor.RaptorError(
        f"{option} is '{text}'; give a number, or START:STOP:COUNT with 2 to 1000 values, such as 0.1:0.9:9"
    )
