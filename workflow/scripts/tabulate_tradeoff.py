"""Collect the cases of the trade-off in one table, and summarise them by method."""

from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path
from raptor.core.jobs import logged
from raptor.studies.tradeoff import summarise

with logged(snakemake.log[0]):
    table = pd.concat([pd.read_csv(path) for path in snakemake.input.cases], ignore_index=True)
    with atomic_path(Path(snakemake.output.table)) as path:
        table.to_csv(path, index=False)
    with atomic_path(Path(snakemake.output.summary)) as path:
        summarise(table).to_csv(path, index=False, float_format="%.4g")
