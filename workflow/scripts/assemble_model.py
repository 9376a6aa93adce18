"""Assemble the networks of a model, and calibrate them on its campaigns' validation splits."""

from dataclasses import replace
from pathlib import Path

import pandas as pd
import torch

from raptor.core.blocks import content_hash
from raptor.core.files import atomic_path
from raptor.core.jobs import logged, progress
from raptor.dataset.stack import read_table
from raptor.moulds import moulds_by_id
from raptor.surrogate.calibration import calibrate
from raptor.surrogate.files import load, read_description, save

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    folders = [Path(weights).parent for weights in snakemake.input.weights]
    trained = [load(folder) for folder in folders]
    surrogate = replace(trained[0], members=tuple(each.members[0] for each in trained))
    paths = zip(snakemake.input.stacks, snakemake.input.moulds, strict=True)
    stacks = {Path(stack): moulds_by_id(Path(moulds)) for stack, moulds in paths}
    with progress("calibration", sum(len(read_table(s).rows("validation")) for s in stacks)) as advance:
        found = calibrate(
            surrogate,
            stacks,
            snakemake.params.seed,
            snakemake.params.fraction,
            lambda s: advance(f"simulation {s}"),
        )
    described = [read_description(folder) for folder in folders]
    save(
        Path(snakemake.output.weights).parent,
        replace(surrogate, calibration=found),
        {name: described[0][name] for name in ("training", "torch")},
        content_hash([content["identity"] for content in described]),
    )
    tables = [pd.read_csv(history) for history in snakemake.input.histories]
    with atomic_path(Path(snakemake.output.history)) as path:
        joined = pd.concat(table.assign(member=number) for number, table in enumerate(tables))
        joined.to_csv(path, index=False)
