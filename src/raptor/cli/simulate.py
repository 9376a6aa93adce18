"""raptor simulate: one tissue by CONDOR."""

from dataclasses import asdict
from math import nan
from typing import Annotated

import typer

from raptor.cli.options import (
    Delta,
    Json,
    KappaNNN,
    KappaNNNN,
    Layers,
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
from raptor.core.errors import RaptorError
from raptor.moulds.library import TISSUES

PIXELS = 256  # along a side of the image that shape is measured in and drawn (paper)


def simulate(
    mould: Mould,
    output: Output,
    delta: Delta = None,
    kappa_nnn: KappaNNN = None,
    kappa_nnnn: KappaNNNN = None,
    tissue: Tissue = None,
    tissues: Tissues = TISSUES,
    scale: Scale = None,
    layers: Layers = 7,
    accuracy: Annotated[str, typer.Option(help="draft, standard, reference or anneal-SWEEPS")] = "standard",
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, help="of every random number")] = 0,
    picture: Picture = None,
    as_json: Json = False,
) -> None:
    """Simulate one mould by CONDOR; write its cells, and a picture of its eight fields.

    Parameters come by flag, or from the paper's fit of a tissue. The file has the form of a shard
    (docs/data.md): cast and final positions, orientations, tensions.

    Example:
      raptor simulate mould.svg --tissue glial_1
          --output tissue.nc --picture tissue.png
      raptor simulate four_post_rectangle
          --delta 0.5 --kappa-nnn 0.5 --kappa-nnnn 0.3 --output tissue.nc
    """
    from raptor.condor.simulate import accuracy_named
    from raptor.condor.simulate import simulate as run_simulation
    from raptor.config import content_hash
    from raptor.dataset.design import Run
    from raptor.dataset.shards import write_shard
    from raptor.fields.shape import shape_ratios
    from raptor.moulds import read_mould
    from raptor.moulds.cast import CastMould
    from raptor.parameters import NetworkModel
    from raptor.raster import rasterise

    parameters = cell_parameters(delta, kappa_nnn, kappa_nnnn, tissue, tissues)
    model = NetworkModel(layers)
    accuracy_named(accuracy)
    shape = read_mould(mould, scale)
    require_writable(output, mould)
    require_picture_writable(picture, mould, output)
    made = run_simulation(shape, parameters, model, accuracy, seed)
    run = Run(0, shape.name, "test", False, parameters, seed)
    values = asdict(parameters)
    identity = content_hash([shape.as_feature(), *values.values(), layers, accuracy, seed])
    write_shard(output, [run], {0: made}, model, accuracy, identity)
    fields = rasterise(made.positions, made.orientation, made.tension, PIXELS)
    try:
        area, width = map(float, shape_ratios(fields[0], CastMould(shape, layers, PIXELS)))
    except RaptorError:  # a mould of few cells may lie between the pixels
        area = width = nan
    if picture is not None:
        from raptor.plotting import fields_figure, save_picture

        save_picture(fields_figure({"simulation": fields}, shape), picture)
    numbers = {
        "mould": shape.name, **values, "layers": layers, "accuracy": accuracy, "seed": seed,
        "cells": made.cells, "energy": made.energy, "converged": made.converged,
        "inverted_fraction": made.inverted_fraction, "area_ratio": area, "width_ratio": width,
        "wall_time": made.wall_time, "output": output, "picture": picture,
    }  # fmt: skip
    state = "converged" if made.converged else "NOT converged"
    sentence = (
        f"{output}: {made.cells} cells, energy {made.energy:.4g} kappa0 l0^2, {state}, "
        f"folded {made.inverted_fraction:.1e}, A/A0 {area:.3f}, w/w0 {width:.3f}, {made.wall_time:.1f} s"
    )
    report(sentence, numbers, as_json)
