"""Measure the seed-to-seed noise of simulations."""

from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path
from raptor.core.jobs import logged
from raptor.moulds import moulds_by_id
from raptor.studies.evaluation import noise_floor

with logged(snakemake.log[0]):
    (stack,), (moulds,) = (map(Path, snakemake.input[name]) for name in ("stack", "moulds"))
    tables = [
        noise_floor(stack, Path(repeats), moulds_by_id(moulds), snakemake.params.layers)
        for repeats in snakemake.input.repeats
    ]
    floor = pd.concat(tables) if tables else pd.DataFrame(columns=["simulation", "mould"])
    with atomic_path(Path(snakemake.output.floor)) as path:
        floor.to_csv(path, index=False)
