"""Fit several tissues with common parameters, by the surrogate and by the simulator."""

from pathlib import Path

import torch

from raptor.core.files import atomic_path, read_json
from raptor.core.jobs import logged
from raptor.fitting import Simulator, Target, fit_joint, surrogate_measure, tabulate_joint, write_fit
from raptor.moulds.reading import read_at_scale
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    params, simulator = snakemake.params, Simulator.configured(snakemake.params.simulator)
    fits = [read_json(Path(path)) for path in snakemake.input.fits]
    targets = {fit["tissue"]: Target(**fit["target"]) for fit in fits}
    moulds = [read_at_scale(path, params.mould_scale) for path in snakemake.input.moulds]
    surrogate = load(Path(snakemake.input.weights[0]).parent)
    predicted = [surrogate_measure(surrogate, mould) for mould in moulds]
    refined = [surrogate_measure(surrogate, mould, averaged=True) for mould in moulds]
    simulated = [simulator.measure(mould) for mould in moulds]
    searches = {"seed": simulator.seed, "budget": params.simulations}
    content = fit_joint(targets, predicted, refined, simulated, **searches)
    write_fit(Path(snakemake.output.fit), content)
    with atomic_path(Path(snakemake.output.table)) as path:
        tabulate_joint(content, fits).to_csv(path, index=False)
