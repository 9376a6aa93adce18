"""Measure the noise of simulations from seed to seed."""

from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path
from raptor.core.jobs import logged
from raptor.moulds import moulds_by_id
from raptor.studies.evaluation import noise_floor

with logged(snakemake.log[0]):
    stack, moulds = Path(snakemake.input.stack), moulds_by_id(Path(snakemake.input.moulds))
    tables = [
        noise_floor(stack, Path(further), moulds, snakemake.params.layers)
        for further in snakemake.input.further
    ]
    floor = pd.concat(tables) if tables else pd.DataFrame(columns=["simulation", "mould"])
    with atomic_path(Path(snakemake.output.floor)) as path:
        floor.to_csv(path, index=False)
