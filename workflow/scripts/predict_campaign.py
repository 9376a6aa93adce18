"""Predict every point of a campaign."""

from pathlib import Path

import torch

from raptor.core.files import atomic_path
from raptor.core.jobs import logged, progress
from raptor.dataset.design import read_design
from raptor.moulds import moulds_by_id
from raptor.studies.sweep import predict, write_predicted
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    (weights,) = snakemake.input.weights
    surrogate = load(Path(weights).parent)
    runs, moulds = read_design(Path(snakemake.input.design)), moulds_by_id(Path(snakemake.input.moulds))
    with progress(
        snakemake.wildcards.campaign, len({(run.mould, run.parameters) for run in runs})
    ) as advance:
        table, fields = predict(surrogate, runs, moulds, advance)
    with atomic_path(Path(snakemake.output.table)) as path:
        table.to_csv(path, index=False)
    write_predicted(Path(snakemake.output.fields), table, fields, surrogate.threshold)
