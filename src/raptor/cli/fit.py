"""raptor fit: parameters of a tissue from its area and width, or from its whole outline."""

from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

import raptor
from raptor.cli import options as opt
from raptor.core.jobs import progress

By = Literal["corrected", "surrogate", "simulator"]
ONE_KIND = "give one kind of measurement: ratios, --tissue NAME, --photo, or --outline"


AreaRatio = Annotated[float | None, typer.Option(help="measured A/A0")]
WidthRatio = Annotated[float | None, typer.Option(help="measured w/w0 (central width)")]
Tissue = Annotated[str | None, typer.Option(help="use the measured ratios of this tissue")]
Outline = Annotated[
    Path | None,
    typer.Option(
        help="GeoJSON from raptor measure, or a picture of the tissue cropped to the frame of 62.5 l0"
    ),
]
Photo = Annotated[
    Path | None,
    typer.Option(help="photograph of the tissue in its mould, measured first as by raptor measure"),
]
Overlay = Annotated[Path | None, typer.Option(help="with --photo: picture of what was measured, to check")]
Model = Annotated[
    By,
    typer.Option(
        help="by the surrogate, corrected by a few simulations; by the surrogate alone; or with a further "
        "search by the simulator"
    ),
]
Layers = Annotated[int | None, typer.Option(help="cell layers of simulations [those of the surrogate]")]
Accuracy = Annotated[str, typer.Option(help="accuracy of simulations: draft, standard or reference")]
Simulations = Annotated[
    int | None, typer.Option(min=1, help="largest number of simulations [3, or 40 by the simulator]")
]
Error = Annotated[
    float | None, typer.Option(help="standard error of a ratio [0.01], or of the outline in l0 [0.25]")
]
Seed = Annotated[int, typer.Option(min=0, max=2**31 - 1, help="seed of every random number")]
Picture = Annotated[
    Path | None,
    typer.Option(help="picture of the fitted tissue and of what the fit leaves open (PNG, SVG or PDF)"),
]


def fit(
    mould: opt.Mould,
    output: Annotated[Path, typer.Option(help="JSON file to write")],
    area_ratio: AreaRatio = None,
    width_ratio: WidthRatio = None,
    tissue: Tissue = None,
    tissues: opt.Tissues = None,
    outline: Outline = None,
    photo: Photo = None,
    overlay: Overlay = None,
    by: Model = "corrected",
    model: opt.Surrogate = None,
    delta: opt.Delta = None,
    kappa_nnn: opt.KappaNNN = None,
    kappa_nnnn: opt.KappaNNNN = None,
    scale: opt.Scale = None,
    mm_per_l0: opt.MmPerL0 = None,
    page: opt.Page = None,
    layers: Layers = None,
    accuracy: Accuracy = "standard",
    simulations: Simulations = None,
    error: Error = None,
    seed: Seed = 0,
    picture: Picture = None,
    as_json: opt.Json = False,
) -> None:
    """Fit delta, kappa_nnn and kappa_nnnn to a measured tissue, with what the fit leaves open.

    Give a photograph, one or both ratios, a tissue of the library, or an outline. Three simulations correct
    the surrogate's fit; --by simulator goes on from there, or from given parameters without a surrogate.

    Example:
      raptor fit glial_1 --tissue glial_1 --output fit.json
      raptor fit mould.svg --area-ratio 0.75 --width-ratio 0.70
          --output fit.json --picture fit.png
      raptor fit mould.svg --photo photograph.png --overlay overlay.png
          --output fit.json --picture fit.png
      raptor fit mould.svg --outline tissue.png --by simulator --output fit.json
    """
    ratios, parameters = (area_ratio, width_ratio), (delta, kappa_nnn, kappa_nnnn)
    ratios = ratios if tissue is None else _measured(tissue, tissues, ratios)
    start = None if parameters == (None, None, None) else opt.cell_parameters(*parameters)
    shape = opt.read_mould(mould, scale, mm_per_l0, page, layers)
    opt.require_writable(output, mould, outline, photo, kind="a JSON file")
    opt.require_picture_writable(picture, mould, outline, photo, output)
    opt.require_picture_writable(overlay, mould, outline, photo, output, picture)
    photograph = _photographed(photo, shape, overlay, ratios, outline)
    if photograph is not None:
        ratios = photograph.area_ratio, photograph.width_ratio if isfinite(photograph.width_ratio) else None
    with progress("fit", None) as advance:
        found = raptor.fit(
            shape, *ratios, outline=outline, by=by, surrogate=model, start=start, layers=layers,
            accuracy=accuracy, simulations=simulations, error=error, seed=seed, on_progress=advance,
        )  # fmt: skip
    found.save(output)
    opt.save_picture(found, picture, photograph=photograph)
    sentence, numbers = _told(found, photograph)
    numbers |= {"mm_per_l0": shape.mm_per_l0, "output": output, "picture": picture}
    words = opt.words(mould, scale, mm_per_l0, page, found.layers)
    opt.report(f"{output}: {sentence}", numbers, as_json, _then(found, words))


def _told(
    found: "raptor.FittedTissue", photograph: "raptor.MeasuredPhotograph | None"
) -> tuple[str, dict[str, Any]]:
    """A fit in words and in numbers, with how far its outline is from that in a photograph."""
    if photograph is None:
        return str(found), dict(found.numbers)
    apart = found.apart(photograph.outline)
    said = f"outlines    {apart:.2f} l0 apart, root mean square, in the photograph and at the fit"
    return f"{found}\n{said}", found.numbers | {"outlines_apart": apart}


def _then(found: "raptor.FittedTissue", mould: str) -> str:
    """The next command: the whole tissue at the fit."""
    p = found.parameters
    point = f"--delta {p.delta:.4g} --kappa-nnn {p.kappa_nnn:.4g} --kappa-nnnn {p.kappa_nnnn:.4g}"
    return f"raptor simulate {mould} {point} --output tissue.nc --picture tissue.png"


def _photographed(
    photo: Path | None,
    mould: "raptor.Mould",
    overlay: Path | None,
    given: tuple[float | None, float | None],
    outline: Path | None,
) -> "raptor.MeasuredPhotograph | None":
    """What is measured in a photograph, if one is given, and an overlay to check it by."""
    if photo is None:
        if overlay is not None:
            raise raptor.RaptorError("--overlay shows what was measured in a photograph; give --photo too")
        return None
    if given != (None, None) or outline is not None:
        raise raptor.RaptorError(ONE_KIND)
    measured = opt.measured(photo, mould, overlay)
    typer.echo(f"{photo}: {measured}", err=True)
    return measured


def _measured(
    name: str, tissues: Path | None, given: tuple[float | None, float | None]
) -> tuple[float | None, float | None]:
    """The measured ratios of a tissue, where none are given besides."""
    tissue = raptor.tissue(name, tissues)
    if given != (None, None):
        raise raptor.RaptorError(ONE_KIND)
    if not tissue.measured:
        raise raptor.RaptorError(
            f"tissue {name} has no measured ratio to fit; give --area-ratio or --width-ratio"
        )
    return tissue.area_ratio, tissue.width_ratio
