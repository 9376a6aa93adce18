"""Draw a fitted tissue."""

import json
from pathlib import Path

from raptor.core.jobs import logged
from raptor.dataset.shards import read_shard
from raptor.dataset.stack import record_fields
from raptor.moulds import read_mould
from raptor.plotting import fit_figure, save, save_fields
from raptor.raster import density_threshold
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    fit = json.loads(Path(snakemake.input.fit).read_text())
    mould = read_mould(Path(snakemake.input.mould)).scaled(fit["mould_scale"])
    (record,) = read_shard(Path(snakemake.input.tissue)).records
    surrogate = load(Path(snakemake.input.weights).parent)
    pixels = surrogate.pixels
    stacks = {
        "prediction": surrogate.predict(mould, [record.parameters])[0],
        "simulation": record_fields(record, pixels),
    }
    rows = [
        {"source": "measured", **fit["target"]},
        {"source": "prediction", **fit["surrogate"]},
        {"source": "simulation", **fit["simulation"]},
    ]
    if snakemake.input.simulator:
        path, tissue = (Path(name) for name in snakemake.input.simulator)
        (other,) = read_shard(tissue).records
        stacks["fit by simulator"] = record_fields(other, pixels)
        rows.append({"source": "fit by simulator", **json.loads(path.read_text())["simulation"]})
    thresholds = dict.fromkeys(stacks, density_threshold(surrogate.layers, pixels))
    thresholds["prediction"] = surrogate.threshold
    densities = {name: stack[0] for name, stack in stacks.items()}
    save(fit_figure(mould, densities, thresholds, rows), Path(snakemake.output.png).with_suffix(""))
    save_fields(Path(snakemake.output.data), stacks)
