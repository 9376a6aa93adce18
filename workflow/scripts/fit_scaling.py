"""Fit the scaling of fields to the training splits of a model's campaigns."""

from pathlib import Path

from raptor.core.jobs import logged
from raptor.dataset.examples import training_scaling
from raptor.dataset.scaling import write_scaling

with logged(snakemake.log[0]):
    stacks, fraction = [Path(stack) for stack in snakemake.input.stacks], snakemake.params.fraction
    scaling = training_scaling(*stacks, fraction=fraction)
    campaigns = [stack.parent.name for stack in stacks]
    write_scaling(Path(snakemake.output.normalisation), scaling, campaigns, fraction)
