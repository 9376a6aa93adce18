"""raptor moulds, raptor tissues: the library of the package."""

from collections.abc import Sequence

import typer

import raptor
from raptor.cli import options as opt


def moulds() -> None:
    """List the moulds of the library: name, size, tethers and what each is.

    Example:
      raptor moulds
    """
    from raptor.moulds.library import MOULDS, describe

    rows = []
    for name in MOULDS:
        mould = raptor.read_mould(name)
        x0, y0, x1, y1 = mould.outline.bounds
        size = f"{x1 - x0:g} x {y1 - y0:g} l0"
        rows.append((name, size, f"{len(mould.tethers)} tethers", describe(name)))
    _table(rows)


def tissues(tissues: opt.Tissues = None) -> None:
    """List the measured tissues of the library: name, mould, ratios and what each is.

    Example:
      raptor tissues
    """
    from raptor.moulds.library.tissues import load_tissues

    rows = []
    for name, tissue in load_tissues(tissues).items():
        ratios = {"A/A0": tissue.area_ratio, "w/w0": tissue.width_ratio}
        said = [f"{ratio} {value:.3f}" for ratio, value in ratios.items() if value is not None]
        rows.append((name, f"mould {tissue.mould}", ", ".join(said) or "not measured", tissue.description))
    _table(rows)


def _table(rows: Sequence[Sequence[str]]) -> None:
    """Print rows in columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        typer.echo("  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip())
