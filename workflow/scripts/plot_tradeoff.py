"""Draw the trade-off."""

from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path
from raptor.core.jobs import logged
from raptor.plotting import save, tradeoff_figure

with logged(snakemake.log[0]):
    table = pd.read_csv(snakemake.input.table)
    save(tradeoff_figure(table), Path(snakemake.output.png).with_suffix(""))
    with atomic_path(Path(snakemake.output.data)) as path:
        table.to_csv(path, index=False)
