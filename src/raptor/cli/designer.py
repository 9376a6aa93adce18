"""raptor designer: a page on which one draws a mould and sees the tissue."""

from pathlib import Path
from typing import Annotated

import typer

import raptor
from raptor.cli import options as opt


def designer(
    output: Annotated[Path, typer.Option(help="HTML page to write")],
    model: opt.Surrogate = None,
    as_json: opt.Json = False,
) -> None:
    """Write the designer: one HTML page on which one draws a mould and sees the predicted tissue.

    The page holds the surrogate and needs neither Python nor a network: send it, open it in a browser.

    Example:
      raptor designer --output designer.html
    """
    if output.suffix.lower() not in (".html", ".htm"):
        raise raptor.RaptorError(f"{output} is not a page's name; give one that ends in .html")
    opt.require_writable(output, kind="a page")
    from raptor.report.designer import write_designer

    size = write_designer(output, model)
    report = {"output": output, "bytes": size}
    opt.report(f"{output}: {size / 1e6:.1f} MB; open it in a browser", report, as_json)
