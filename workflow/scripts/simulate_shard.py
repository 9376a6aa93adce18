"""Simulate the runs of one shard."""

from pathlib import Path

from raptor.core.device import chosen_device
from raptor.core.jobs import logged, progress
from raptor.dataset.design import read_design
from raptor.dataset.run import simulate_shard
from raptor.dataset.shards import write_shard
from raptor.moulds import moulds_by_id
from raptor.parameters import NetworkModel

with logged(snakemake.log[0]):
    first, last = (int(number) for number in snakemake.wildcards.shard.split("-"))
    runs = [run for run in read_design(Path(snakemake.input.design)) if first <= run.simulation <= last]
    moulds = moulds_by_id(Path(snakemake.input.moulds), {run.mould for run in runs})
    params = snakemake.params
    model = NetworkModel.configured(params.simulator)
    accuracy = params.simulator["accuracy"]
    device = chosen_device("auto", snakemake.resources.get("gpu", 0))
    with progress(f"{snakemake.wildcards.campaign} {snakemake.wildcards.shard}", len(runs)) as advance:
        simulations, failures = simulate_shard(
            runs,
            moulds,
            model,
            accuracy,
            device,
            lambda run, outcome: advance(f"{run.simulation}: {outcome}"),
        )
    write_shard(
        Path(snakemake.output.shard),
        runs,
        simulations,
        model,
        accuracy,
        params.configuration,
        failures,
        device,
    )
