"""Draw the bulk statistics of the test split."""

import json
from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path
from raptor.core.jobs import logged
from raptor.fields.metrics import BULK
from raptor.plotting import bulk_figure, save

with logged(snakemake.log[0]):
    metrics = pd.read_csv(snakemake.input.metrics)
    summary = json.loads(Path(snakemake.input.summary).read_text())["test"]
    save(bulk_figure(metrics, summary), Path(snakemake.output.png).with_suffix(""))
    columns = [f"{name}_{source}" for name in BULK for source in ("simulated", "predicted")]
    with atomic_path(Path(snakemake.output.data)) as path:
        metrics[["simulation", *columns]].to_csv(path, index=False)
