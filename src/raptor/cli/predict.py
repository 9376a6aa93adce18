"""raptor predict: the eight fields of a mould by a trained surrogate, and how far to trust them."""

from pathlib import Path
from typing import Annotated

import typer

from raptor.cli.options import (
    Delta,
    Json,
    KappaNNN,
    KappaNNNN,
    Mould,
    Output,
    Picture,
    Scale,
    Tissue,
    Tissues,
    cell_parameters,
    report,
    require_picture_writable,
    require_writable,
)
from raptor.moulds.library import TISSUES


def predict(
    mould: Mould,
    output: Output,
    model: Annotated[
        Path | None,
        typer.Option(help="folder with weights.safetensors and model.json; without it the shipped model"),
    ] = None,
    delta: Delta = None,
    kappa_nnn: KappaNNN = None,
    kappa_nnnn: KappaNNNN = None,
    tissue: Tissue = None,
    tissues: Tissues = TISSUES,
    scale: Scale = None,
    picture: Picture = None,
    json: Json = False,
) -> None:
    """Predict the eight fields of a mould by a trained surrogate, with bands that hold 50, 80 and 95 %.

    Says so where mould or parameters are unlike what the surrogate was trained on.

    Example:
      raptor predict four_post_rectangle
          --delta 0.5 --kappa-nnn 0.5 --kappa-nnnn 0.3
          --output tissue.nc --picture tissue.png
    """
    from raptor.moulds import read_mould
    from raptor.surrogate.files import SHIPPED, load, write_prediction

    parameters = cell_parameters(delta, kappa_nnn, kappa_nnnn, tissue, tissues).require_sampled("prediction")
    shape = read_mould(mould, scale)
    require_writable(output, mould)
    require_picture_writable(picture, mould, output)
    surrogate = load(model or SHIPPED)
    prediction = surrogate.examine(shape, parameters)
    write_prediction(output, prediction)
    if picture is not None:
        from raptor.plotting import fields_figure, save_picture

        save_picture(fields_figure({"prediction": prediction.fields}, shape), picture)
    (area, width), half = prediction.ratios, prediction.ratio_bands.half[-1]
    sentence = (
        f"{output}: A/A0 {area:.3f} +- {half[0]:.3f}, w/w0 {width:.3f} +- {half[1]:.3f} (95 % bands, "
        f"{surrogate.layers} layers)"
    )
    if prediction.out_of_distribution:
        sentence += (
            "\nunlike the training set, so do not trust these bands, and simulate: "
            f"distance {prediction.distance:.1f}, disagreement {prediction.disagreement:.1f} (usual: below 1)"
        )
    numbers = {
        "output": output, "area_ratio": area, "area_ratio_band95": half[0], "width_ratio": width,
        "width_ratio_band95": half[1], "distance": prediction.distance,
        "disagreement": prediction.disagreement, "unlike": prediction.out_of_distribution,
        "layers": surrogate.layers,
    }  # fmt: skip
    report(sentence, numbers, json)
