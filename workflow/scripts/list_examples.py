"""List the examples of a campaign."""

from pathlib import Path

from raptor.core.jobs import logged
from raptor.dataset.examples import list_examples, write_examples

with logged(snakemake.log[0]):
    write_examples(Path(snakemake.output.examples), list_examples(Path(snakemake.input.stack)))
