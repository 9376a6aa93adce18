"""Fit one tissue by the surrogate, correct the fit by a few simulations, and simulate both again."""

from pathlib import Path

import torch

from raptor.core.jobs import logged
from raptor.dataset.design import Run
from raptor.dataset.shards import write_shard
from raptor.fitting import Simulator, Target, fit_tissue, write_fit
from raptor.moulds import read_mould
from raptor.parameters import CellParameters
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    params, tissue = snakemake.params, snakemake.params.tissue
    simulator = Simulator.configured(params.simulator)
    mould = read_mould(Path(snakemake.input.mould)).scaled(params.mould_scale)
    target = Target(tissue["area_ratio"], tissue["width_ratio"])
    limits = {"starts": params.starts, "corrections": params.corrections, "repeats": params.repeats}
    surrogate = load(Path(snakemake.input.weights).parent)
    found, simulation = fit_tissue(surrogate, simulator, mould, target, **limits)
    parameters = CellParameters(**found["surrogate"]["parameters"])
    first = Run(0, mould.name, "test", False, parameters, simulator.seed_of(1))
    path = Path(snakemake.output.tissue)
    write_shard(path, [first], {0: simulation}, simulator.model, simulator.accuracy, params.configuration)
    about = {name: tissue[name] for name in ("description", "paper")}
    content = {"tissue": snakemake.wildcards.tissue, "mould_scale": params.mould_scale, **about, **found}
    write_fit(Path(snakemake.output.fit), content)
