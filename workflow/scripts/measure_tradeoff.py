"""Compare methods on one mould and one set of parameters."""

from pathlib import Path

from raptor.core.files import atomic_path
from raptor.core.jobs import logged, progress
from raptor.moulds.reading import read_at_scale
from raptor.studies.tradeoff import REFERENCES, Trial, compare

with logged(snakemake.log[0]):
    surrogate = None
    if snakemake.input.surrogate:
        import torch  # not needed to compare simulations

        from raptor.surrogate.files import load

        torch.set_num_threads(snakemake.threads)
        surrogate = load(Path(snakemake.input.surrogate[0]).parent)
    about, methods = snakemake.params.trial, snakemake.params.methods
    trial = Trial.of(about, read_at_scale(snakemake.input.mould, about["mould_scale"]))
    with progress(trial.name, REFERENCES + len(methods)) as advance:
        table = compare(trial, methods, surrogate, advance)
    with atomic_path(Path(snakemake.output.table)) as path:
        table.to_csv(path, index=False)
