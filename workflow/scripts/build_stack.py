"""Rasterise the shards into the field stack."""

from pathlib import Path

from raptor.core.device import chosen_device
from raptor.core.jobs import logged, progress
from raptor.dataset.design import read_design
from raptor.dataset.stack import build_stack
from raptor.moulds import moulds_by_id

with logged(snakemake.log[0]):
    runs = read_design(Path(snakemake.input.design))
    with progress("field stack", len(runs)) as advance:
        build_stack(
            Path(snakemake.output.stack),
            [Path(shard) for shard in snakemake.input.shards],
            runs,
            moulds_by_id(Path(snakemake.input.moulds)),
            snakemake.params.pixels,
            simulation_configuration=snakemake.params.simulation_configuration,
            configuration=snakemake.params.configuration,
            device=chosen_device("auto", snakemake.resources.get("gpu", 0)),
            on_progress=lambda row: advance(f"sample {row}"),
        )
