"""raptor predict: one tissue by a trained surrogate, with error bands."""

from dataclasses import replace
from typing import Annotated

import typer

import raptor
from raptor.cli import options as opt
from raptor.core.jobs import progress

Samples = Annotated[
    int,
    typer.Option(min=0, max=16, help="possible tissues to write too, of a surrogate that samples"),
]


def predict(
    mould: opt.Mould,
    output: opt.Output,
    model: opt.Surrogate = None,
    delta: opt.Delta = None,
    kappa_nnn: opt.KappaNNN = None,
    kappa_nnnn: opt.KappaNNNN = None,
    tissue: opt.Tissue = None,
    tissues: opt.Tissues = None,
    scale: opt.Scale = None,
    mm_per_l0: opt.MmPerL0 = None,
    page: opt.Page = None,
    picture: opt.Picture = None,
    fields: opt.Fields = False,
    samples: Samples = 0,
    as_json: opt.Json = False,
) -> None:
    """Predict the tissue of a mould by a trained surrogate, with 50, 80 and 95 % bands.

    Warns if mould or parameters are unlike the training set.

    Example:
      raptor predict four_post_rectangle
          --delta 0.5 --kappa-nnn 0.5 --kappa-nnnn 0.3
          --output tissue.nc --picture tissue.png
    """
    cells = opt.cell_parameters(delta, kappa_nnn, kappa_nnnn, tissue, tissues)
    cells.require_sampled("prediction")
    shape = opt.read_mould(mould, scale, mm_per_l0, page)
    opt.require_writable(output, mould)
    opt.require_picture_writable(picture, mould, output)
    with progress("prediction", None):
        surrogate = raptor.load_surrogate(model)
        if samples:
            surrogate.require_samples()
        found = replace(raptor.predict(shape, cells, surrogate), kept=samples)
    point = f"--delta {cells.delta:g} --kappa-nnn {cells.kappa_nnn:g} --kappa-nnnn {cells.kappa_nnnn:g}"
    words = opt.words(mould, scale, mm_per_l0, page, found.layers)
    then = f"raptor simulate {words} {point} --output simulated.nc" if found.unusual else ""
    opt.finish(found, output, picture, fields, as_json, then)
