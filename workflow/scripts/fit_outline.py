"""Fit a simulated tissue, whose parameters are known, by its ratios and by its whole outline."""

import json
from pathlib import Path

import torch

from raptor.core.jobs import logged
from raptor.dataset.shards import read_shard
from raptor.dataset.stack import record_fields
from raptor.fitting import recover, write_fit
from raptor.moulds import read_mould
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    fit = json.loads(Path(snakemake.input.fit).read_text())
    mould = read_mould(Path(snakemake.input.mould)).scaled(fit["mould_scale"])
    (record,) = read_shard(Path(snakemake.input.tissue)).records
    surrogate = load(Path(snakemake.input.weights).parent)
    density = record_fields(record, surrogate.pixels)[0]
    searches = {"starts": snakemake.params.starts, "seed": snakemake.params.seed % 2**31}
    content = recover(surrogate, mould, density, record.parameters, **searches)
    write_fit(Path(snakemake.output.fit), {"tissue": fit["tissue"], **content})
