"""Compare methods on one mould and one set of parameters."""

from pathlib import Path

import torch

from raptor.files import atomic_path
from raptor.jobs import logged, progress
from raptor.moulds import read_mould
from raptor.surrogate.files import load
from raptor.tradeoff import Case, Comparison, compare

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    params = snakemake.params.comparison
    chosen = params["comparison"]
    case = Case.of(params, read_mould(Path(snakemake.input.mould)))
    comparison = Comparison(
        methods=tuple(chosen["methods"]),
        layers=tuple(chosen["layers"]),
        shells=tuple(tuple(shells) for shells in chosen["shells"]),
        pixels=tuple(chosen["pixels"]),
        seeds=chosen["seeds"],
    )
    trained = snakemake.input.surrogate
    surrogate = load(Path(trained[0]).parent) if trained else None
    with progress(case.name, comparison.runs) as done:
        table = compare(case, comparison, surrogate, done)
    with atomic_path(Path(snakemake.output.table)) as path:
        table.to_csv(path, index=False)
