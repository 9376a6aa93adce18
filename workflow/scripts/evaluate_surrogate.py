"""Evaluate the surrogate on the test split."""

import json
from pathlib import Path

import torch

from raptor.dataset.examples import read_examples
from raptor.dataset.stack import read_table
from raptor.evaluation import evaluate, summarise, training_mean
from raptor.files import atomic_path
from raptor.jobs import logged, progress
from raptor.moulds import moulds_by_id
from raptor.surrogate.inference import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    stack = Path(snakemake.input.stack)
    moulds = moulds_by_id(Path(snakemake.input.moulds))
    mean = training_mean(stack, read_examples(Path(snakemake.input.examples)))
    surrogate = load(Path(snakemake.input.weights).parent)
    with progress("evaluation", len(read_table(stack).rows("test"))) as done:
        metrics = evaluate(surrogate, stack, moulds, mean, lambda s: done(f"simulation {s}"))
    with atomic_path(Path(snakemake.output.metrics)) as path:
        metrics.to_csv(path, index=False)
    with atomic_path(Path(snakemake.output.summary)) as path:
        path.write_text(json.dumps(summarise(metrics), indent=1) + "\n")
