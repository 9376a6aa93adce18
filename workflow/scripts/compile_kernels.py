"""Compile every kernel by one tiny simulation."""

import time
from pathlib import Path

import shapely

from raptor.condor.simulate import simulate
from raptor.core.compiled import source_hash
from raptor.core.files import write_json
from raptor.core.jobs import logged
from raptor.moulds import Mould
from raptor.parameters import CellParameters, NetworkModel
from raptor.raster import rasterise

with logged(snakemake.log[0]):
    started = time.perf_counter()
    mould = Mould(shapely.box(-2, -2, 2, 2), name="kernels")
    for accuracy in ("standard", "standard-float32"):
        tissue = simulate(mould, CellParameters(0.1, 0.5, 0.3), NetworkModel(2), accuracy)
    rasterise(tissue.positions, tissue.orientation, tissue.tension, 32)
    content = {"sources": source_hash(), "seconds": round(time.perf_counter() - started, 2)}
    write_json(Path(snakemake.output.kernels), content)
