"""Put every model's cost and errors into one table."""

import json
from pathlib import Path

import pandas as pd
import torch

from raptor.evaluation import compare, regions_of, summarise
from raptor.files import atomic_path
from raptor.jobs import logged
from raptor.surrogate.costs import costs_of
from raptor.surrogate.files import describe, load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    floor = pd.read_csv(snakemake.input.floor)
    names, costs = snakemake.params.names, []
    for weights, history in zip(snakemake.input.weights, snakemake.input.histories, strict=True):
        folder = Path(weights).parent
        costs.append({"model": folder.name} | costs_of(load(folder), describe(folder), pd.read_csv(history)))
    costs += [{"model": name} for name in names[len(costs) :]]
    tables = zip(names, snakemake.input.metrics, strict=True)
    summaries = {name: summarise(pd.read_csv(metrics), floor) for name, metrics in tables}
    judged: dict[str, dict[str, pd.DataFrame]] = {}
    for metrics in map(Path, snakemake.input.judged):
        judged.setdefault(metrics.parent.name, {})[metrics.stem] = pd.read_csv(metrics)
    regions = [regions_of(found).assign(model=name) for name, found in judged.items()]
    with atomic_path(Path(snakemake.output.regions)) as path:
        pd.concat(regions).to_csv(path, index=False)
    with atomic_path(Path(snakemake.output.table)) as path:
        compare(summaries, costs).to_csv(path, index=False)
    with atomic_path(Path(snakemake.output.summary)) as path:
        path.write_text(json.dumps(summaries, indent=1) + "\n")
