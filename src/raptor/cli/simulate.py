"""raptor simulate: one tissue by CONDOR."""

from typing import Annotated

import typer

import raptor
from raptor.cli import options as opt
from raptor.core.jobs import progress
from raptor.parameters import LAYERS


def simulate(
    mould: opt.Mould,
    output: opt.Output,
    delta: opt.Delta = None,
    kappa_nnn: opt.KappaNNN = None,
    kappa_nnnn: opt.KappaNNNN = None,
    tissue: opt.Tissue = None,
    tissues: opt.Tissues = None,
    scale: opt.Scale = None,
    mm_per_l0: opt.MmPerL0 = None,
    page: opt.Page = None,
    layers: opt.Layers = LAYERS,
    accuracy: Annotated[str, typer.Option(help="draft, standard, reference or anneal-SWEEPS")] = "standard",
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, help="seed of every random number")] = 0,
    picture: opt.Picture = None,
    fields: opt.Fields = False,
    as_json: opt.Json = False,
) -> None:
    """Simulate the tissue of a mould with CONDOR.

    Give parameters by flags or take them from the paper's fit of a tissue. The file contains the fields, the
    mould and the cells (docs/data.md).

    Example:
      raptor simulate mould.svg --tissue glial_1
          --output tissue.nc --picture tissue.png
      raptor simulate four_post_rectangle
          --delta 0.5 --kappa-nnn 0.5 --kappa-nnnn 0.3 --output tissue.nc
    """
    cells = opt.cell_parameters(delta, kappa_nnn, kappa_nnnn, tissue, tissues)
    shape = opt.read_mould(mould, scale, mm_per_l0, page, layers)
    opt.require_writable(output, mould)
    opt.require_picture_writable(picture, mould, output)
    with progress("simulation", None):
        found = raptor.simulate(shape, cells, layers, accuracy, seed)
    opt.finish(found, output, picture, fields, as_json)
