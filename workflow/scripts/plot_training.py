"""Draw the training curves."""

from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path
from raptor.core.jobs import logged
from raptor.plotting import save, training_figure

with logged(snakemake.log[0]):
    table = pd.read_csv(snakemake.input.history)
    save(training_figure(table), Path(snakemake.output.png).with_suffix(""))
    with atomic_path(Path(snakemake.output.data)) as path:
        table.to_csv(path, index=False)
