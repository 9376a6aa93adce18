"""Draw the surrogate's errors by region of the parameters."""

from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path
from raptor.core.jobs import logged
from raptor.plotting import regions_figure, save

with logged(snakemake.log[0]):
    metrics, regions = (pd.read_csv(snakemake.input[name]) for name in ("metrics", "regions"))
    save(regions_figure(metrics, regions), Path(snakemake.output.png).with_suffix(""))
    with atomic_path(Path(snakemake.output.data)) as path:
        regions.to_csv(path, index=False)
