"""Summarise a model's errors: test split, regions of the parameters, other campaigns."""

from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path, write_json
from raptor.core.jobs import logged
from raptor.studies.evaluation import regions_of, summarise

with logged(snakemake.log[0]):
    floor = pd.read_csv(snakemake.input.floor)
    tables = {Path(path).stem: pd.read_csv(path) for path in snakemake.input.metrics}
    first = next(iter(tables))
    summary = {name: summarise(table, floor if name == first else None) for name, table in tables.items()}
    with atomic_path(Path(snakemake.output.metrics)) as path:
        tables[first].to_csv(path, index=False)
    write_json(Path(snakemake.output.summary), summary)
    with atomic_path(Path(snakemake.output.regions)) as path:
        regions_of(tables).to_csv(path, index=False)
