"""Fit one tissue, and simulate it again at the fitted parameters."""

from dataclasses import asdict
from pathlib import Path

import torch

from raptor.condor import simulate
from raptor.dataset.design import Run
from raptor.dataset.shards import write_shard
from raptor.fitting import Target, fit, measure_simulation, surrogate_measure, write_fit
from raptor.jobs import logged
from raptor.moulds import read_mould
from raptor.parameters import NetworkModel
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    params = snakemake.params
    tissue, seed = params.tissue, params.seed % 2**31
    mould = read_mould(Path(snakemake.input.mould)).scaled(params.mould_scale)
    surrogate = load(Path(snakemake.input.weights).parent)
    target = Target(tissue["area_ratio"], tissue["width_ratio"])
    fitted = fit(surrogate_measure(surrogate, mould), target, starts=params.starts, seed=seed)
    model = NetworkModel(params.model["layers"], tuple(params.model["shells"]), params.model["tension"])
    simulation = simulate(mould, fitted.parameters, model, params.accuracy, seed)
    measured = measure_simulation(simulation, mould, model, surrogate.pixels, target)
    run = Run(0, mould.name, "test", False, fitted.parameters, seed)
    write_shard(
        Path(snakemake.output.tissue),
        [run],
        {0: simulation},
        model,
        params.accuracy,
        params.configuration,
    )
    content = {
        "tissue": snakemake.wildcards.tissue,
        "description": tissue["description"],
        "mould_scale": params.mould_scale,
        "target": asdict(target),
        "surrogate": asdict(fitted),
        "simulation": measured,
        "paper": tissue["paper"],
    }
    write_fit(Path(snakemake.output.fit), content)
