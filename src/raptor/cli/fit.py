"""raptor fit: parameters of a tissue from its area and width, or from its whole outline."""

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from raptor.cli.options import (
    Delta,
    Json,
    KappaNNN,
    KappaNNNN,
    Mould,
    Scale,
    Tissues,
    cell_parameters,
    report,
    require_picture_writable,
    require_writable,
)
from raptor.core.errors import RaptorError
from raptor.moulds.library import TISSUES

By = Literal["surrogate", "simulator"]


def fit(
    mould: Mould,
    output: Annotated[Path, typer.Option(help="JSON file to write")],
    area_ratio: Annotated[float | None, typer.Option(help="measured A/A0")] = None,
    width_ratio: Annotated[float | None, typer.Option(help="measured w/w0, of the central width")] = None,
    tissue: Annotated[str | None, typer.Option(help="tissue whose measured ratios to take")] = None,
    tissues: Tissues = TISSUES,
    outline: Annotated[
        Path | None,
        typer.Option(
            help="picture of the tissue, or a mask, cropped to the frame of 62.5 l0 about the mould"
        ),
    ] = None,
    by: Annotated[
        By, typer.Option(help="what a fit asks: the surrogate, or from there on CONDOR")
    ] = "surrogate",
    model: Annotated[
        Path | None, typer.Option(help="the surrogate's folder; without it the shipped model")
    ] = None,
    delta: Delta = None,
    kappa_nnn: KappaNNN = None,
    kappa_nnnn: KappaNNNN = None,
    scale: Scale = None,
    layers: Annotated[
        int | None, typer.Option(help="cell layers of simulations; without it those of the surrogate")
    ] = None,
    accuracy: Annotated[str, typer.Option(help="of simulations: draft, standard or reference")] = "standard",
    simulations: Annotated[int, typer.Option(min=1, help="simulations that a fit may make")] = 40,
    error: Annotated[
        float | None,
        typer.Option(help="standard error of a ratio (0.01), or of the outline in l0 (0.25)"),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**31 - 1, help="of every random number")] = 0,
    picture: Annotated[
        Path | None, typer.Option(help="picture of the tissue at the fit to write, PNG or SVG")
    ] = None,
    as_json: Json = False,
) -> None:
    """Fit delta, kappa_nnn and kappa_nnnn to a tissue in its mould, and say what is left open.

    Give what was measured: one or both ratios, a tissue's name for those of the library, or a picture
    of the tissue for its whole outline. Two ratios cannot determine three parameters: the intervals in the
    output are those of the valley (docs/fits.md). By the simulator, the search starts at the surrogate's fit,
    or at the parameters given, and then needs no surrogate.

    Example:
      raptor fit glial_1 --tissue glial_1 --output fit.json
      raptor fit mould.svg --area-ratio 0.75 --width-ratio 0.70
          --output fit.json --picture fit.png
      raptor fit mould.svg --outline tissue.png --by simulator --output fit.json
    """
    from raptor.fitting.command import Request, fit_for
    from raptor.fitting.simulator import Simulator
    from raptor.fitting.tables import write_fit
    from raptor.moulds import read_mould
    from raptor.parameters import NetworkModel
    from raptor.surrogate.files import SHIPPED, load

    start = None
    if (delta, kappa_nnn, kappa_nnnn) != (None, None, None):
        if by == "surrogate":
            raise RaptorError("parameters are where a fit by the simulator starts; give --by simulator too")
        start = cell_parameters(delta, kappa_nnn, kappa_nnnn).require_sampled("fit")
    target = _target(area_ratio, width_ratio, tissue, tissues, outline)
    shape = read_mould(mould, scale)
    require_writable(output, mould, outline, kind="a JSON file")
    require_picture_writable(picture, mould, outline, output)
    surrogate = None if start is not None else load(model or SHIPPED)
    if surrogate is not None and layers not in (None, surrogate.layers):
        raise RaptorError(
            f"layers is {layers}, but this surrogate is of {surrogate.layers}; leave it out, or start the "
            "simulator from parameters of your own (--delta, --kappa-nnn, --kappa-nnnn)"
        )
    thick = surrogate.layers if surrogate is not None else layers or 7
    simulator = Simulator(NetworkModel(thick), accuracy, surrogate.pixels if surrogate else 256, seed)
    request = Request(shape, target, simulator, surrogate, start, by == "simulator", simulations, error)
    content, density = fit_for(request)
    write_fit(output, content)
    if picture is not None:
        from raptor.plotting import fit_figure, save_picture

        rows = [{"source": "measured", **content["target"]}, {"source": by, **content["fit"]}]
        save_picture(fit_figure(shape, {by: density}, {by: request.threshold}, rows), picture)
    report(_sentence(output, content), _numbers(content) | {"output": output, "picture": picture}, as_json)


def _target(
    area_ratio: float | None,
    width_ratio: float | None,
    tissue: str | None,
    tissues: Path,
    outline: Path | None,
) -> Any:
    """What was measured, given in exactly one of three ways: a Target or an Outline."""
    from raptor.fitting.outline import read_outline
    from raptor.fitting.targets import Target

    ratios = area_ratio is not None or width_ratio is not None
    if ratios + (tissue is not None) + (outline is not None) != 1:
        raise RaptorError(
            "give what was measured in one way: --area-ratio and --width-ratio (or one of them), "
            "--tissue NAME, or --outline PICTURE"
        )
    if outline is not None:
        return read_outline(outline)
    if tissue is not None:
        from raptor.moulds.library.tissues import tissue as tissue_named

        found = tissue_named(tissue, tissues)
        if not found.measured:
            raise RaptorError(
                f"tissue {tissue} has no measured ratio to fit; give --area-ratio or --width-ratio"
            )
        area_ratio, width_ratio = found.area_ratio, found.width_ratio
    for name, value in (("area ratio", area_ratio), ("width ratio", width_ratio)):
        if value is not None and not 0 < value <= 1.5:
            raise RaptorError(f"the {name} is {value}; a ratio to the mould's lies between 0 and 1.5")
    return Target(area_ratio, width_ratio)


def _numbers(content: dict[str, Any]) -> dict[str, Any]:
    """A fit's numbers, without nesting."""
    found = content["fit"]
    numbers = found["parameters"] | {key: value for key, value in found.items() if key != "parameters"}
    for name, interval in content["intervals"].items():
        numbers |= {f"{name}_{end}": value for end, value in interval.items()}
    return {**numbers, "reachable": content["reachable"]}


def _sentence(output: Path, content: dict[str, Any]) -> str:
    """A fit for people."""
    found, parts = content["fit"], []
    for name, value in found["parameters"].items():
        interval = content["intervals"].get(name)
        known = f" ({interval['lower']:.2f} to {interval['upper']:.2f})" if interval else ""
        parts.append(f"{name} {value:.3f}{known}")
    sentence = (
        f"{output}: {', '.join(parts)}; A/A0 {found['area_ratio']:.3f}, w/w0 {found['width_ratio']:.3f}, "
    )
    sentence += (
        f"outlines {found['distance']:.2f} l0 apart" if "distance" in found else f"rss {found['rss']:.1e}"
    )
    if found["rank"] < 3:
        sentence += (
            f"\nonly {found['rank']} combinations of the three parameters are determined: other parameters "
            "fit as well"
        )
    if content["reachable"] is False:
        sentence += "\nno parameters give what was measured on this mould, so do not trust the fit"
    return sentence
