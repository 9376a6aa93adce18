"""Put simulated and predicted contraction of every mould into one table, and say where they differ most."""

import json
from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path
from raptor.core.jobs import logged
from raptor.studies.sweep import compare, differences

with logged(snakemake.log[0]):
    pairs = zip(snakemake.input.simulated, snakemake.input.predicted, strict=True)
    tables = [compare(Path(a).parent.name, pd.read_csv(a), pd.read_csv(b)) for a, b in pairs]
    table = pd.concat(tables, ignore_index=True)
    with atomic_path(Path(snakemake.output.table)) as path:
        table.to_csv(path, index=False)
    with atomic_path(Path(snakemake.output.differences)) as path:
        path.write_text(json.dumps(differences(table), indent=1) + "\n")
