"""Summarise a model's errors on each campaign, and by region of the parameters."""

from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path, write_json
from raptor.core.jobs import logged
from raptor.studies.evaluation import regions_of, summarise

with logged(snakemake.log[0]):
    tables, floors = (
        {Path(path).stem: pd.read_csv(path) for path in snakemake.input[name]}
        for name in ("metrics", "floors")
    )
    first = next(iter(tables))
    summary = {name: summarise(table, floors.get(name)) for name, table in tables.items()}
    with atomic_path(Path(snakemake.output.metrics)) as path:
        tables[first].to_csv(path, index=False)
    write_json(Path(snakemake.output.summary), summary)
    with atomic_path(Path(snakemake.output.regions)) as path:
        regions_of(tables, snakemake.params.campaigns).to_csv(path, index=False)
