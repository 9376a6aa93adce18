"""Compare accuracy levels and the surrogate on held-out moulds."""

from pathlib import Path

import torch

from raptor.dataset.design import read_design
from raptor.files import atomic_path
from raptor.jobs import logged, progress
from raptor.moulds import read_moulds
from raptor.parameters import NetworkModel
from raptor.surrogate.inference import load
from raptor.tradeoff import Case, compare, spread_over_delta

with logged(snakemake.log[0]):
    torch.set_num_threads(1)
    given, chosen = snakemake.params.model, snakemake.params.tradeoff
    model = NetworkModel(given["layers"], tuple(given["shells"]), given["tension"])
    surrogate = load(Path(snakemake.input.weights).parent)
    moulds = {mould.name: mould for mould in read_moulds(Path(snakemake.input.moulds))}
    runs = spread_over_delta(read_design(Path(snakemake.input.design)), chosen["simulations"])
    cases = [Case(run, moulds[run.mould], model, surrogate.architecture.pixels) for run in runs]
    total = len(cases) * (chosen["seeds"] + len(chosen["accuracies"]))
    with progress("trade-off", total) as done:
        table = compare(cases, tuple(chosen["accuracies"]), chosen["seeds"], surrogate, done)
    with atomic_path(Path(snakemake.output.table)) as path:
        table.to_csv(path, index=False)
