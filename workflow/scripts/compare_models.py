"""Collect cost and errors of all models in one table."""

from pathlib import Path

import pandas as pd
import torch

from raptor.core.files import atomic_path, read_json
from raptor.core.jobs import logged
from raptor.studies.evaluation import by_campaign, compare
from raptor.surrogate.costs import costs_of
from raptor.surrogate.files import load, read_description

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    summaries = {Path(summary).parent.name: read_json(Path(summary)) for summary in snakemake.input.summaries}
    on_main = {name: summary[snakemake.params.campaign] for name, summary in summaries.items()}
    costs: dict[str, dict] = {name: {"model": name} for name in summaries}
    trained: dict[str, dict] = {}
    histories = {Path(file).parent.name: pd.read_csv(file) for file in snakemake.input.histories}
    for name, weights in zip(snakemake.params.models, snakemake.input.weights, strict=True):
        folder = Path(weights).parent
        costs[name] |= costs_of(load(folder), histories.get(name))
        if name in histories:
            trained[name] = read_description(folder)["training"]
    with atomic_path(Path(snakemake.output.table)) as path:
        compare(on_main, costs.values()).to_csv(path, index=False)
    with atomic_path(Path(snakemake.output.campaigns)) as path:
        by_campaign(summaries, trained).to_csv(path, index=False)
    regions = {Path(file).parent.name: pd.read_csv(file) for file in snakemake.input.regions}
    with atomic_path(Path(snakemake.output.regions)) as path:
        pd.concat(table.assign(model=name) for name, table in regions.items()).to_csv(path, index=False)
