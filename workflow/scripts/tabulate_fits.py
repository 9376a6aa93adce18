"""Collect the fits in one table."""

from pathlib import Path

from raptor.core.files import atomic_path, read_json
from raptor.core.jobs import logged
from raptor.fitting import tabulate

with logged(snakemake.log[0]), atomic_path(Path(snakemake.output.table)) as path:
    named = (snakemake.input.get(name, []) for name in ("fits", "simulators"))
    fits, simulators = ([read_json(Path(file)) for file in files] for files in named)
    tabulate(fits, simulators).to_csv(path, index=False)
