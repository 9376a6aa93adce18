"""Predict every point of a sweep."""

from pathlib import Path

import torch

from raptor.config import Sweep
from raptor.core.files import atomic_path
from raptor.core.jobs import logged, progress
from raptor.moulds import read_moulds
from raptor.studies.sweep import predict
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    (mould,) = read_moulds(Path(snakemake.input.moulds))
    grid = Sweep.model_validate(snakemake.params.sweep).grid()
    surrogate = load(Path(snakemake.input.weights).parent)
    with progress(f"sweep {mould.name}", len(grid.points)) as advance:
        table = predict(surrogate, mould, grid, lambda point: advance(f"point {point}"))
    with atomic_path(Path(snakemake.output.table)) as path:
        table.to_csv(path, index=False)
