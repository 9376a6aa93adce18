"""Evaluate a model, or a baseline without a network, on the test runs of a campaign."""

from pathlib import Path

from raptor.core.files import atomic_path
from raptor.core.jobs import logged, progress
from raptor.dataset.examples import read_examples
from raptor.dataset.stack import read_table
from raptor.moulds import moulds_by_id
from raptor.studies.evaluation import evaluate, predictor_of
from raptor.surrogate.baselines import baseline

with logged(snakemake.log[0]):
    stack, moulds = Path(snakemake.input.stack), moulds_by_id(Path(snakemake.input.moulds))
    if snakemake.input.weights:
        import torch  # not needed by baselines

        from raptor.surrogate.files import load

        torch.set_num_threads(snakemake.threads)
        answer = predictor_of(load(Path(snakemake.input.weights[0]).parent))
    else:
        examples = read_examples(Path(snakemake.input.examples[0]))
        answer = baseline(snakemake.wildcards.model, stack, examples)
    with progress("evaluation", len(read_table(stack).rows("test"))) as advance:
        metrics = evaluate(answer, stack, moulds, lambda s: advance(f"simulation {s}"))
    with atomic_path(Path(snakemake.output.metrics)) as path:
        metrics.to_csv(path, index=False)
