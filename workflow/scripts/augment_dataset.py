"""List the examples and fit the scaling; write the augmented stack where asked."""

from pathlib import Path

from raptor.core.jobs import logged
from raptor.dataset.examples import augment, materialise, training_scaling, write_examples
from raptor.dataset.scaling import write_scaling

with logged(snakemake.log[0]):
    stack = Path(snakemake.input.stack)
    examples = augment(stack)
    write_examples(Path(snakemake.output.examples), examples)
    write_scaling(Path(snakemake.output.normalisation), training_scaling(stack))
    for path in snakemake.output.get("augmented", []):
        materialise(Path(path), stack, examples, snakemake.params.configuration)
