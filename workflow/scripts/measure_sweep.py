"""Measure every simulation of a sweep."""

from pathlib import Path

from raptor.core.files import atomic_path
from raptor.core.jobs import logged, progress
from raptor.dataset.design import read_design
from raptor.moulds import read_moulds
from raptor.studies.sweep import measure

with logged(snakemake.log[0]):
    (mould,) = read_moulds(Path(snakemake.input.moulds))
    with progress(f"sweep {mould.name}", len(read_design(Path(snakemake.input.design)))) as advance:
        table = measure(
            map(Path, snakemake.input.shards),
            mould,
            snakemake.params.layers,
            snakemake.params.pixels,
            snakemake.params.configuration,
            lambda simulation: advance(f"simulation {simulation}"),
        )
    with atomic_path(Path(snakemake.output.table)) as path:
        table.to_csv(path, index=False)
