"""raptor draw: a mould as the model sees it."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from raptor.cli.options import Json, Layers, Mould, Scale, report, require_picture_writable, require_writable
from raptor.core.errors import RaptorError


def draw(
    mould: Mould,
    output: Annotated[Path | None, typer.Option(help="picture to write, PNG or SVG")] = None,
    scale: Scale = None,
    layers: Layers = 7,
    like: Annotated[
        Path | None, typer.Option(help="another mould to compare with, drawn dashed beside the first")
    ] = None,
    geojson: Annotated[Path | None, typer.Option(help="GeoJSON file to convert the mould to")] = None,
    as_json: Json = False,
) -> None:
    """Draw a mould as the model sees it, in numbers and a picture; convert it to GeoJSON.

    The picture shows the frame of 62.5 l0, the outline, the tethers in red and the cells of the lowest layer.
    Look at it before simulating a mould of your own.

    Example:
      raptor draw mould.svg --output mould.png
      raptor draw mask.png --scale 0.05 --geojson mould.geojson
      raptor draw mask.png --like mould.geojson --json
    """
    from raptor.moulds import read_mould, write_moulds
    from raptor.moulds.cast import cast_sites
    from raptor.moulds.summary import summarise
    from raptor.parameters import NetworkModel

    NetworkModel(layers)  # says which numbers of layers are allowed
    require_picture_writable(output, mould, like, geojson)
    if geojson is not None:
        if geojson.suffix not in (".geojson", ".json"):
            raise RaptorError(f"{geojson} is no GeoJSON's name; give one that ends in .geojson")
        require_writable(geojson, mould, like, kind="a GeoJSON file")
    shape = read_mould(mould, scale)
    other = None if like is None else read_mould(like)
    cells = cast_sites(shape, layers)
    summary = summarise(shape)
    numbers: dict[str, Any] = asdict(summary) | {"layers": layers, "cells": len(cells)}
    if other is not None:
        numbers["like_cells"] = len(cast_sites(other, layers))
        difference = shape.depression.symmetric_difference(other.depression).area
        numbers["like_difference"] = difference / other.depression.area
    if output is not None:
        from raptor.plotting import mould_figure, save_picture

        lowest = cells[cells[:, 2] == cells[0, 2], :2]
        save_picture(mould_figure(shape, lowest, _title(numbers), other), output)
    if geojson is not None:
        write_moulds(geojson, [shape])
    written = {"picture": output, "geojson": geojson}
    sentence = f"{mould}: " + ", ".join(f"{name} {value}" for name, value in _title(numbers).items())
    report(sentence, numbers | written, as_json)


def _title(numbers: dict[str, Any]) -> dict[str, str]:
    """What is said of a mould, by name, for people."""
    said = {
        "mould": numbers["mould"],
        "size": f"{numbers['width']:.4g} x {numbers['height']:.4g} l0",
        "area": f"{numbers['area']:.5g} l0^2",
        "tethers": f"{numbers['tethers']}",
        "symmetry": numbers["symmetry"].replace("_", " "),
        "cells": f"{numbers['cells']:,} in {numbers['layers']} layers",
    }
    if "like_cells" in numbers:
        said["compared"] = (
            f"{numbers['like_cells']:,} cells, {100 * numbers['like_difference']:.2f} % of area apart"
        )
    return said
