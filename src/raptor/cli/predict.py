"""raptor predict: the eight fields of a mould by a trained surrogate."""

from pathlib import Path
from typing import Annotated

import typer

from raptor.cli.options import Delta, KappaNNN, KappaNNNN, Mould, Output, cell_parameters, require_writable


def predict(
    mould: Mould,
    output: Output,
    model: Annotated[Path, typer.Option(help="folder with weights.safetensors and model.json")],
    delta: Delta = None,
    kappa_nnn: KappaNNN = None,
    kappa_nnnn: KappaNNNN = None,
) -> None:
    """Predict the eight fields of a mould by a trained surrogate.

    Example:
      raptor predict config/moulds/four_post_rectangle.geojson
          --delta 0.5 --kappa-nnn 0.5 --kappa-nnnn 0.3
          --model results/laptop/surrogate/pix2pix --output tissue.nc
    """
    from raptor.condor import cast_sites
    from raptor.moulds import read_mould
    from raptor.surrogate.inference import load, write_prediction

    parameters = cell_parameters(delta, kappa_nnn, kappa_nnnn).require_sampled("prediction")
    shape = read_mould(mould)
    require_writable(output)
    cast_sites(shape, 1)  # a mould without a cell has no tissue to predict
    surrogate = load(model)
    area, width = write_prediction(output, surrogate, shape, parameters)
    typer.echo(f"{output}: A/A0 {area:.3f}, w/w0 {width:.3f} ({surrogate.layers} layers)")
