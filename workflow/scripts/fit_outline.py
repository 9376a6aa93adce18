"""Fit a simulated tissue with known parameters, by its ratios and by its whole outline."""

from pathlib import Path

import torch

from raptor.core.jobs import logged
from raptor.dataset.shards import read_shard
from raptor.dataset.stack import record_fields
from raptor.fitting import recover, write_fit
from raptor.moulds.reading import read_at_scale
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    mould = read_at_scale(snakemake.input.mould, snakemake.params.mould_scale)
    (record,) = read_shard(Path(snakemake.input.tissue)).records
    surrogate = load(Path(snakemake.input.weights[0]).parent)
    density = record_fields(record, surrogate.pixels)[0]
    content = recover(surrogate, mould, density, record.parameters, seed=snakemake.params.seed % 2**31)
    write_fit(Path(snakemake.output.fit), {"tissue": snakemake.wildcards.tissue, **content})
