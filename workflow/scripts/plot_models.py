"""Draw every model's training, cost and errors."""

from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path
from raptor.core.jobs import logged
from raptor.plotting import models_figure, save

with logged(snakemake.log[0]):
    table = pd.read_csv(snakemake.input.table)
    histories = {Path(path).parent.name: pd.read_csv(path) for path in snakemake.input.histories}
    save(models_figure(table, histories), Path(snakemake.output.png).with_suffix(""))
    with atomic_path(Path(snakemake.output.data)) as path:
        table.to_csv(path, index=False)
