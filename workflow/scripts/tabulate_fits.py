"""Collect the fits in one table."""

import json
from pathlib import Path

from raptor.files import atomic_path
from raptor.fitting import tabulate
from raptor.jobs import logged

with logged(snakemake.log[0]), atomic_path(Path(snakemake.output.table)) as path:
    table = tabulate([json.loads(Path(fit).read_text()) for fit in snakemake.input.fits])
    table.to_csv(path, index=False)
