"""Fit one tissue by the surrogate, and simulate it again at the fitted parameters."""

from dataclasses import asdict
from pathlib import Path

import torch

from raptor.dataset.design import Run
from raptor.dataset.shards import write_shard
from raptor.fitting import Simulator, Target, fit, measure_again, surrogate_measure, write_fit
from raptor.jobs import logged
from raptor.moulds import read_mould
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    params, tissue = snakemake.params, snakemake.params.tissue
    simulator = Simulator.configured(params.simulator)
    mould = read_mould(Path(snakemake.input.mould)).scaled(params.mould_scale)
    surrogate = load(Path(snakemake.input.weights).parent)
    target = Target(tissue["area_ratio"], tissue["width_ratio"])
    start, fine = (surrogate_measure(surrogate, mould, averaged=averaged) for averaged in (False, True))
    fitted = fit(start, target, starts=params.starts, seed=simulator.seed, fine=fine)
    runs = [simulator.run(mould, fitted.parameters, further) for further in range(1, params.repeats + 1)]
    first = Run(0, mould.name, "test", False, fitted.parameters, simulator.seed_of(1))
    path = Path(snakemake.output.tissue)
    write_shard(path, [first], {0: runs[0]}, simulator.model, simulator.accuracy, params.configuration)
    content = {
        "tissue": snakemake.wildcards.tissue,
        "description": tissue["description"],
        "mould_scale": params.mould_scale,
        "target": asdict(target),
        "surrogate": asdict(fitted),
        "simulation": measure_again(runs, simulator, mould, target),
        "paper": tissue["paper"],
    }
    write_fit(Path(snakemake.output.fit), content)
