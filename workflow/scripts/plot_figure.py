"""Draw a figure from files of the run."""

from pathlib import Path

from raptor.core.jobs import logged
from raptor.plotting.catalogue import draw

with logged(snakemake.log[0]):
    stem = Path(snakemake.output.png).with_suffix("")
    draw(snakemake.params.kind, dict(snakemake.input.items()), stem, **snakemake.params.options)
