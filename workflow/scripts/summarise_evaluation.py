"""Gather the surrogate's errors: test split, regions of the parameters, further sets."""

import json
from pathlib import Path

import pandas as pd

from raptor.evaluation import by_region, summarise
from raptor.files import atomic_path
from raptor.jobs import logged

with logged(snakemake.log[0]):
    floor = pd.read_csv(snakemake.input.floor)
    tables = {Path(path).stem: pd.read_csv(path) for path in snakemake.input.metrics}
    test = tables["test"]
    summary = {name: summarise(table, floor if name == "test" else None) for name, table in tables.items()}
    regions = [by_region(test)]
    for name, table in tables.items():
        if name != "test":
            regions.append(by_region(table).head(1).assign(region=f"further: {name}"))
    with atomic_path(Path(snakemake.output.metrics)) as path:
        test.to_csv(path, index=False)
    with atomic_path(Path(snakemake.output.summary)) as path:
        path.write_text(json.dumps(summary, indent=1) + "\n")
    with atomic_path(Path(snakemake.output.regions)) as path:
        pd.concat(regions).to_csv(path, index=False)
