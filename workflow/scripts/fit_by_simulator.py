"""Fit one tissue by the simulator, from the surrogate's fit, and verify the fit with new seeds."""

from dataclasses import asdict
from pathlib import Path
from time import perf_counter

from raptor.core.files import read_json
from raptor.core.jobs import logged
from raptor.dataset.design import Run
from raptor.dataset.shards import write_shard
from raptor.fitting import Fit, Simulator, Target, descend_by_simulation, measure_again, unit_of, write_fit
from raptor.fitting.simulator import REPLICATES
from raptor.moulds.reading import read_at_scale
from raptor.parameters import CellParameters

with logged(snakemake.log[0]):
    params = snakemake.params
    before = read_json(Path(snakemake.input.fit))
    simulator, target = Simulator.configured(params.simulator), Target(**before["target"])
    mould = read_at_scale(snakemake.input.mould, params.mould_scale)
    start = unit_of(CellParameters(**before["corrected"]["parameters"]))
    measure, begun = simulator.measure(mould), perf_counter()
    fitted = Fit.at(descend_by_simulation(measure, target.residuals, start, params.simulations))
    seconds = perf_counter() - begun
    runs = simulator.replicates(mould, fitted.parameters, REPLICATES)
    first = Run(0, mould.name, "test", fitted.parameters, simulator.seed_of(1))
    path = Path(snakemake.output.tissue)
    write_shard(path, [first], {0: runs[0]}, simulator.model, simulator.accuracy, params.configuration)
    again = measure_again(runs, simulator, mould, target)
    content = {
        "tissue": before["tissue"],
        "fit": asdict(fitted),
        "simulation": again,
        "simulator_seconds": seconds,
    }
    write_fit(Path(snakemake.output.fit), content)
