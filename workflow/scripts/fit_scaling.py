"""Fit the scaling of fields to the training split of a campaign."""

from pathlib import Path

from raptor.core.jobs import logged
from raptor.dataset.examples import training_scaling
from raptor.dataset.scaling import write_scaling

with logged(snakemake.log[0]):
    (stack,) = map(Path, snakemake.input.stack)
    write_scaling(Path(snakemake.output.normalisation), training_scaling(stack), stack.parent.name)
