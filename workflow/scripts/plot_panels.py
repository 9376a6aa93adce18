"""Draw densities over a sweep, simulated over predicted."""

from pathlib import Path

import torch

from raptor.config import Sweep
from raptor.core.jobs import logged
from raptor.dataset.design import read_design
from raptor.moulds import read_moulds
from raptor.plotting import panels_figure, save, save_panels
from raptor.studies.sweep import tissues
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    sweep = Sweep.model_validate(snakemake.params.sweep)
    (mould,) = read_moulds(Path(snakemake.input.moulds))
    found = tissues(
        [point for point in sweep.grid().points if point[0] in sweep.panels],
        map(Path, snakemake.input.shards),
        read_design(Path(snakemake.input.design)),
        mould,
        load(Path(snakemake.input.weights).parent),
        snakemake.params.configuration,
    )
    save(panels_figure(found, mould), Path(snakemake.output.png).with_suffix(""))
    save_panels(Path(snakemake.output.data), found)
