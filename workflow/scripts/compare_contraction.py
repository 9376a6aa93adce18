"""Compare simulated and predicted contraction of a campaign, and find the largest difference."""

from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path, write_json
from raptor.core.jobs import logged
from raptor.studies.sweep import contraction, differences

with logged(snakemake.log[0]):
    predicted = pd.read_csv(snakemake.input.predicted) if snakemake.input.predicted else None
    table = contraction(pd.read_csv(snakemake.input.simulated), predicted)
    with atomic_path(Path(snakemake.output.table)) as path:
        table.to_csv(path, index=False)
    write_json(Path(snakemake.output.differences), differences(table))
