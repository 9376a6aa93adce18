"""Measure the seed-to-seed noise of a campaign."""

from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path
from raptor.core.jobs import logged
from raptor.moulds import moulds_by_id
from raptor.studies.evaluation import noise_floor

with logged(snakemake.log[0]):
    stack, moulds = (Path(snakemake.input[name]) for name in ("stack", "moulds"))
    tables = [noise_floor(stack, Path(repeats), moulds_by_id(moulds)) for repeats in snakemake.input.repeats]
    with atomic_path(Path(snakemake.output.floor)) as path:
        pd.concat(tables).to_csv(path, index=False)
