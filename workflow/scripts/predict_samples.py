"""Predict the held-out samples shown in figures."""

from pathlib import Path

import pandas as pd
import torch

from raptor.core.jobs import logged
from raptor.moulds import moulds_by_id
from raptor.studies.evaluation import median_and_worst, predict_samples
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    names = ("stack", "moulds", "metrics", "weights")
    stack, moulds, metrics, weights = (Path(snakemake.input[name][0]) for name in names)
    table, by_id = pd.read_csv(metrics), moulds_by_id(moulds)
    chosen = table.set_index("simulation").loc[median_and_worst(table)]
    predict_samples(Path(snakemake.output.samples), load(weights.parent), stack, by_id, chosen)
