"""raptor draw: a mould as the model sees it."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

import raptor
from raptor.cli import options as opt
from raptor.parameters import LAYERS


def draw(
    mould: opt.Mould,
    output: Annotated[Path | None, typer.Option(help="picture to write (PNG or SVG)")] = None,
    scale: opt.Scale = None,
    mm_per_l0: opt.MmPerL0 = None,
    page: opt.Page = None,
    layers: opt.Layers = LAYERS,
    like: Annotated[Path | None, typer.Option(help="another mould to compare with, drawn dashed")] = None,
    geojson: Annotated[Path | None, typer.Option(help="GeoJSON file to write the mould to")] = None,
    as_json: opt.Json = False,
) -> None:
    """Draw a mould as the model sees it, print its numbers, or convert it to GeoJSON.

    The picture shows the frame of 62.5 l0, the outline, the tethers in red and the cells of the lowest layer.
    Check it before you simulate your own mould.

    Example:
      raptor draw mould.svg --output mould.png
      raptor draw plate.dxf --mm-per-l0 0.1
      raptor draw mask.png --scale 0.05 --geojson mould.geojson
      raptor draw mask.png --like mould.geojson --json
    """
    from raptor.moulds import write_moulds
    from raptor.moulds.summary import area_apart, summarise

    opt.require_picture_writable(output, mould, like, geojson)
    if geojson is not None:
        if geojson.suffix not in (".geojson", ".json"):
            raise raptor.RaptorError(f"{geojson} is not a GeoJSON file name; give one that ends in .geojson")
        opt.require_writable(geojson, mould, like, kind="a GeoJSON file")
    shape = raptor.read_mould(mould, scale, mm_per_l0, page)
    summary = summarise(shape, raptor.NetworkModel(layers).layers)
    numbers, rows = dict[str, Any](asdict(summary)), summary.rows
    other = None if like is None else raptor.read_mould(like)
    if other is not None:
        apart, cells = area_apart(shape, other), summarise(other, layers).cells
        numbers |= {"like_cells": cells, "like_difference": apart}
        rows["compared"] = f"{cells:,} cells, {100 * apart:.2f} % of area apart"
    if output is not None:
        from raptor.plotting import mould_figure, save_picture

        save_picture(mould_figure(shape, rows, other), output)
    if geojson is not None:
        write_moulds(geojson, [shape])
    sentence = f"{mould}: " + ", ".join(f"{name} {value}" for name, value in rows.items())
    words = opt.words(mould, scale, mm_per_l0, page, layers)
    then = f"raptor simulate {words} --tissue glial_1 --output tissue.nc"
    opt.report(sentence, numbers | {"picture": output, "geojson": geojson}, as_json, then)
