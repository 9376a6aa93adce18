"""Simulate a tissue of which only delta is known, over the range of spring constants."""

from pathlib import Path

from raptor.core.files import atomic_path
from raptor.core.jobs import logged, progress
from raptor.fitting import Simulator, simulate_at_delta
from raptor.fitting.bound import CORNERS
from raptor.moulds import read_mould

with logged(snakemake.log[0]), progress("simulations", len(CORNERS)) as advance:
    params = snakemake.params
    mould = read_mould(Path(snakemake.input.mould)).scaled(params.mould_scale)
    table = simulate_at_delta(Simulator.configured(params.simulator), mould, params.delta, advance)
    with atomic_path(Path(snakemake.output.table)) as path:
        table.to_csv(path, index=False)
