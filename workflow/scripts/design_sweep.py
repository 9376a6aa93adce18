"""Write the runs of a mould's sweep, and the mould at its scale."""

from dataclasses import replace
from pathlib import Path

from raptor.config import Sweep
from raptor.core.jobs import logged
from raptor.dataset.design import write_design
from raptor.dataset.sweep import sweep_runs
from raptor.moulds import read_mould, write_moulds

with logged(snakemake.log[0]):
    sweep = Sweep.model_validate(snakemake.params.sweep)
    mould = read_mould(Path(snakemake.input.mould)).scaled(sweep.mould_scale)
    mould = replace(mould, name=snakemake.wildcards.sweep)
    write_design(Path(snakemake.output.design), sweep_runs(sweep.grid(), mould, snakemake.params.seed))
    write_moulds(Path(snakemake.output.moulds), [mould])
