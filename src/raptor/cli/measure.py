"""raptor measure: area ratio, width ratio and outline of a tissue in a photograph."""

from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from raptor.cli import options as opt

Photograph = Annotated[Path, typer.Argument(help="photograph, or two-valued mask (PNG, TIFF, JPEG)")]
Look = Annotated[str, typer.Option("--tissue", help="bright, dark or auto: the tissue against the floor")]
Threshold = Annotated[
    float | None, typer.Option(help="brightness between floor and tissue, relative to the plate [Otsu's]")
]
Landmarks = Annotated[
    list[str] | None,
    typer.Option("--landmark", help='"column,row=x,y" or "column,row=tether 1"; at least two'),
]
Aligned = Annotated[bool, typer.Option("--aligned", help="the image is the frame, 62.5 l0 wide")]
Channel = Annotated[
    str | None,
    typer.Option(help="red, green, blue, saturation or hue: what tells tissue from floor [luminance]"),
]
Mirrored = Annotated[bool, typer.Option("--mirrored", help="taken from below or in a mirror")]


def measure(
    image: Photograph,
    mould: Annotated[Path, typer.Option(help="mould by name, or a file: SVG, DXF, GeoJSON or a picture")],
    scale: opt.Scale = None,
    mm_per_l0: opt.MmPerL0 = None,
    mould_page: Annotated[int | None, typer.Option(help="page of a mould's picture that has several")] = None,
    page: opt.Page = None,
    channel: Channel = None,
    look: Look = "auto",
    threshold: Threshold = None,
    landmarks: Landmarks = None,
    aligned: Aligned = False,
    mirrored: Mirrored = False,
    overlay: Annotated[Path | None, typer.Option(help="picture to check by eye, PNG or SVG")] = None,
    outline: Annotated[Path | None, typer.Option(help="GeoJSON of the outline, in l0")] = None,
    as_json: opt.Json = False,
) -> None:
    """Measure A/A0, w/w0 and the outline of a tissue in a photograph or mask.

    Example:
      raptor measure photograph.png --mould four_post_rectangle
          --overlay overlay.png --outline tissue.geojson
      raptor measure stack.tif --page 3 --channel hue --mould mould.svg
    """
    opt.require_picture_writable(overlay, image, mould, outline)
    if outline is not None:
        opt.require_writable(outline, image, mould, kind="a GeoJSON file")
    shape = opt.read_mould(mould, scale, mm_per_l0, mould_page)
    measured = opt.measured(
        image, shape, overlay, look=look, threshold=threshold, landmarks=landmarks or (), aligned=aligned,
        mirrored=mirrored, page=page, channel=channel,
    )  # fmt: skip
    if outline is not None:
        measured.save(outline)
    ratios = f"--area-ratio {measured.area_ratio:.4f}"
    if isfinite(measured.width_ratio):
        ratios += f" --width-ratio {measured.width_ratio:.4f}"
    then = f"raptor fit {opt.words(mould, scale, mm_per_l0, mould_page)} {ratios} --output fit.json"
    opt.report(f"{image}: {measured}", measured.numbers, as_json, then)
