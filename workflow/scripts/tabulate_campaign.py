"""Tabulate the measures of every simulation of a campaign."""

from pathlib import Path

from raptor.core.files import atomic_path
from raptor.core.jobs import logged
from raptor.studies.sweep import tabulate

with logged(snakemake.log[0]), atomic_path(Path(snakemake.output.table)) as path:
    tabulate(Path(snakemake.input.stack)).to_csv(path, index=False)
