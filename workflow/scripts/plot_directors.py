"""Draw directors over density, simulated beside predicted."""

from pathlib import Path

import torch

from raptor.config import Sweep
from raptor.core.jobs import logged
from raptor.dataset.design import read_design
from raptor.moulds import read_moulds
from raptor.plotting import directors_figure, save, save_fields
from raptor.studies.sweep import middle_points, tissues
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    sweep = Sweep.model_validate(snakemake.params.sweep)
    surrogate = load(Path(snakemake.input.weights).parent)
    points, shards = middle_points(sweep.grid(), sweep.panels), [Path(s) for s in snakemake.input.shards]
    drawn = []
    for design, moulds in zip(snakemake.input.designs, snakemake.input.moulds, strict=True):
        (mould,) = read_moulds(Path(moulds))
        own = [shard for shard in shards if shard.parent == Path(design).parent]
        runs = read_design(Path(design))
        for tissue in tissues(points, own, runs, mould, surrogate, snakemake.params.configuration):
            drawn.append((tissue, mould))
    save(directors_figure(drawn, surrogate.threshold), Path(snakemake.output.png).with_suffix(""))
    stacks = {
        f"{mould.name}_delta_{tissue.point[0]:g}_{source}": fields
        for tissue, mould in drawn
        for source, fields in tissue.sources.items()
    }
    save_fields(Path(snakemake.output.data), stacks)
