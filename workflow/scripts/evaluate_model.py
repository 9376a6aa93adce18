"""Evaluate a model on a set."""

from pathlib import Path

import torch

from raptor.core.files import atomic_path
from raptor.core.jobs import logged, progress
from raptor.dataset.stack import read_table
from raptor.moulds import moulds_by_id
from raptor.studies.evaluation import evaluate, predictor_of
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    stack = Path(snakemake.input.stack)
    surrogate = load(Path(snakemake.input.weights).parent)
    with progress("evaluation", len(read_table(stack).rows("test"))) as advance:
        metrics = evaluate(
            predictor_of(surrogate),
            stack,
            moulds_by_id(Path(snakemake.input.moulds)),
            surrogate.layers,
            lambda simulation: advance(f"simulation {simulation}"),
        )
    with atomic_path(Path(snakemake.output.metrics)) as path:
        metrics.to_csv(path, index=False)
