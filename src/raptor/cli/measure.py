"""raptor measure: area ratio, width ratio and outline of a tissue in a photograph."""

import json
from pathlib import Path
from typing import Annotated

import typer

from raptor.cli.options import Json, Scale, require_writable

Picture = Annotated[Path, typer.Argument(help="photograph, or two-valued mask (PNG, TIFF, JPEG)")]
Look = Annotated[str, typer.Option("--tissue", help="bright, dark or auto: the tissue against the floor")]
Threshold = Annotated[
    float | None, typer.Option(help="brightness between floor and tissue, relative to the plate [Otsu's]")
]
Landmarks = Annotated[
    list[str] | None,
    typer.Option("--landmark", help='"column,row=x,y" or "column,row=tether 1"; at least two'),
]
Aligned = Annotated[bool, typer.Option("--aligned", help="the image is the frame, 62.5 l0 wide")]
Mirrored = Annotated[bool, typer.Option("--mirrored", help="taken from below or in a mirror")]


def measure(
    image: Picture,
    mould: Annotated[Path, typer.Option(help="mould by name, or a GeoJSON, SVG or PNG file")],
    scale: Scale = None,
    look: Look = "auto",
    threshold: Threshold = None,
    landmarks: Landmarks = None,
    aligned: Aligned = False,
    mirrored: Mirrored = False,
    overlay: Annotated[Path | None, typer.Option(help="PNG to check by eye")] = None,
    outline: Annotated[Path | None, typer.Option(help="GeoJSON of the outline, in l0")] = None,
    as_json: Json = False,
) -> None:
    """Measure A/A0, w/w0 and the outline of a tissue in a photograph or mask.

    Example:
      raptor measure photograph.png --mould four_post_rectangle
          --overlay overlay.png --outline tissue.geojson
    """
    from raptor import imaging
    from raptor.core.files import atomic_path
    from raptor.imaging.report import as_feature, as_record, as_sentence
    from raptor.moulds import read_mould

    appearance, shape = imaging.appearance_named(look), read_mould(mould, scale)
    for output, other in ((overlay, outline), (outline, overlay)):
        if output is not None:
            require_writable(output, image, mould, other, kind="a file")
    picture = imaging.read_picture(image)
    registration = imaging.register(picture, shape, landmarks or (), aligned, mirrored)
    measured = imaging.measure(picture, shape, registration, appearance, threshold)
    if overlay is not None:
        from raptor.plotting.overlay import write_overlay

        write_overlay(overlay, picture, shape, measured)
    if outline is not None:
        with atomic_path(outline) as temporary:
            temporary.write_text(json.dumps(as_feature(measured, picture, shape)) + "\n", encoding="utf-8")
    if as_json:
        typer.echo(json.dumps(as_record(measured, picture, shape)))
    else:
        typer.echo(f"{image}: {as_sentence(measured, picture)}")
