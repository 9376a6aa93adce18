"""Compare methods on one mould and one set of parameters."""

from pathlib import Path

import torch

from raptor.core.files import atomic_path
from raptor.core.jobs import logged, progress
from raptor.moulds import read_mould
from raptor.studies.tradeoff import Case, Comparison, compare
from raptor.surrogate.files import load

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
    with progress(case.name, comparison.runs) as advance:
        table = compare(case, comparison, surrogate, advance)
    with atomic_path(Path(snakemake.output.table)) as path:
        table.to_csv(path, index=False)
