"""Evaluate a guess without a network on the test split."""

from pathlib import Path

from raptor.core.files import atomic_path
from raptor.core.jobs import logged, progress
from raptor.dataset.examples import read_examples
from raptor.dataset.stack import read_table
from raptor.moulds import moulds_by_id
from raptor.studies.evaluation import evaluate
from raptor.surrogate.baselines import baseline

with logged(snakemake.log[0]):
    stack, examples = Path(snakemake.input.stack), read_examples(Path(snakemake.input.examples))
    guess = baseline(snakemake.wildcards.model, stack, examples)
    with progress("evaluation", len(read_table(stack).rows("test"))) as advance:
        moulds = moulds_by_id(Path(snakemake.input.moulds))
        metrics = evaluate(
            guess, stack, moulds, snakemake.params.layers, lambda s: advance(f"simulation {s}")
        )
    with atomic_path(Path(snakemake.output.metrics)) as path:
        metrics.to_csv(path, index=False)
