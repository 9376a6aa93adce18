"""Infer the posterior of a tissue's parameters, and rank measurements that would narrow it."""

from pathlib import Path

import numpy as np
import pandas as pd
import torch

from raptor.core.files import atomic_path, read_json
from raptor.core.jobs import logged, progress
from raptor.fitting import PARAMETERS, Simulator, Target, infer, simulate_draws, summarise, survey, write_fit
from raptor.fitting.experimental_design import DRAWS, rank_measurements
from raptor.fitting.tissue import common_error
from raptor.moulds.reading import read_at_scale
from raptor.surrogate.files import load

with logged(snakemake.log[0]), progress("draws", DRAWS) as advance:
    torch.set_num_threads(snakemake.threads)
    params, fit = snakemake.params, read_json(Path(snakemake.input.fit))
    simulator, target = Simulator.configured(params.simulator), Target(**fit["target"])
    mould = read_at_scale(snakemake.input.mould, params.mould_scale)
    surrogate = load(Path(snakemake.input.weights[0]).parent)
    surveyed = survey(surrogate, mould, simulator.seed, threads=snakemake.threads)
    found = surveyed.shifted(common_error(surrogate, mould, fit))
    posterior = infer(found, target, simulator.seed)
    sampled = simulate_draws(posterior, simulator, mould, on_progress=advance)
    drawn = posterior.draws(1000, simulator.seed)
    columns = np.column_stack([posterior.parameters[drawn], posterior.values[drawn]])
    points = pd.DataFrame(columns, columns=[*PARAMETERS, *posterior.names])
    ranked = rank_measurements(posterior, sampled, target, simulator.seed)
    tables = {"points": points, "draws": sampled.table, "experimental_design": ranked}
    for name, table in tables.items():
        with atomic_path(Path(snakemake.output[name])) as path:
            table.to_csv(path, index=False)
    write_fit(Path(snakemake.output.posterior), {"tissue": fit["tissue"], **summarise(posterior)})
