"""Fit one tissue by the surrogate, correct the fit by a few simulations, and verify both."""

from pathlib import Path

import torch

from raptor.core.jobs import logged
from raptor.dataset.design import Run
from raptor.dataset.result import save
from raptor.dataset.shards import write_shard
from raptor.fitting import PARAMETERS, Simulator, Target, fit_tissue, write_fit
from raptor.moulds.reading import read_at_scale
from raptor.parameters import CellParameters
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    params, tissue = snakemake.params, snakemake.params.tissue
    simulator = Simulator.configured(params.simulator)
    surrogate = load(Path(snakemake.input.weights[0]).parent)
    mould = read_at_scale(snakemake.input.mould, params.mould_scale)
    target, paper = Target(tissue["area_ratio"], tissue["width_ratio"]), tissue["paper"]
    published = CellParameters(*(paper[name] for name in PARAMETERS)) if PARAMETERS[0] in paper else None
    found, simulation = fit_tissue(surrogate, simulator, mould, target, published=published)
    parameters = CellParameters(**found["surrogate"]["parameters"])
    first = Run(0, mould.name, "test", parameters, simulator.seed_of(1))
    path = Path(snakemake.output.tissue)
    write_shard(path, [first], {0: simulation}, simulator.model, simulator.accuracy, params.configuration)
    save(surrogate.examine(mould, parameters), snakemake.output.prediction)
    about = {name: tissue[name] for name in ("description", "paper")}
    write_fit(Path(snakemake.output.fit), {"tissue": snakemake.wildcards.tissue, **about, **found})
