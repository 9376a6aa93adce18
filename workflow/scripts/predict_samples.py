"""Predict, and simulate with further seeds, the held-out samples shown in figures."""

from pathlib import Path

import pandas as pd
import torch

from raptor.core.jobs import logged, progress
from raptor.fitting import Simulator
from raptor.moulds import moulds_by_id
from raptor.studies.shown import median_and_worst, predict_samples
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    names = ("stack", "moulds", "metrics", "weights")
    stack, moulds, metrics, weights = (Path(snakemake.input[name][0]) for name in names)
    table, by_id = pd.read_csv(metrics), moulds_by_id(moulds)
    chosen = table.set_index("simulation").loc[median_and_worst(table)]
    simulator = Simulator.configured(snakemake.params.simulator)
    surrogate, seeds = load(weights.parent), snakemake.params.seeds
    with progress("samples shown in figures", len(chosen)) as advance:
        predict_samples(
            Path(snakemake.output.samples),
            surrogate,
            stack,
            by_id,
            chosen,
            lambda s: [
                simulator.fields(tissue)[0]
                for tissue in simulator.replicates(by_id[s.mould], s.parameters, seeds)
            ],
            advance,
        )
