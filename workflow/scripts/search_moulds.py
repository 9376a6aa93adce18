"""Search for moulds as a specification asks."""

from pathlib import Path

import torch

from raptor.core.jobs import log, logged
from raptor.optimisation.command import design
from raptor.plotting import designs_figure, front_figure, save

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    found = design(snakemake.input.spec, Path(snakemake.input.weights[0]).parent, log.info)
    folder = found.save(Path(snakemake.output.table).parent)
    save(front_figure(found), Path(snakemake.output.figure).with_suffix(""))
    save(designs_figure(found), folder / "moulds_found")
    log.info("%s", found)
