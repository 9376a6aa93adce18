"""Draw whether the surrogate's bands hold what they promise."""

import json
from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path
from raptor.core.jobs import logged
from raptor.plotting import calibration_figure, save

with logged(snakemake.log[0]):
    metrics = pd.read_csv(snakemake.input.metrics)
    summary = json.loads(Path(snakemake.input.summary).read_text())["test"]
    save(calibration_figure(metrics, summary), Path(snakemake.output.png).with_suffix(""))
    with atomic_path(Path(snakemake.output.data)) as path:
        pd.Series(summary["coverage"], name="share").rename_axis("band").to_csv(path)
