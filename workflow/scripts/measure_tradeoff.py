"""Compare methods on one mould and one set of parameters."""

from pathlib import Path

from raptor.core.files import atomic_path
from raptor.core.jobs import logged, progress
from raptor.moulds import read_mould
from raptor.studies.tradeoff import REFERENCES, Trial, compare

with logged(snakemake.log[0]):
    surrogate = None
    if snakemake.input.surrogate:
        import torch  # not needed to compare simulations

        from raptor.surrogate.files import load

        torch.set_num_threads(snakemake.threads)
        surrogate = load(Path(snakemake.input.surrogate[0]).parent)
    trial = Trial.of(snakemake.params.trial, read_mould(Path(snakemake.input.mould)))
    methods = snakemake.params.methods
    with progress(trial.name, REFERENCES + len(methods)) as advance:
        table = compare(trial, methods, surrogate, advance)
    with atomic_path(Path(snakemake.output.table)) as path:
        table.to_csv(path, index=False)
