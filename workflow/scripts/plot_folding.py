"""Draw a tissue unfolded and folded."""

from pathlib import Path

import pandas as pd

from raptor.condor.energy import inverted_share
from raptor.condor.lattice import build_lattice
from raptor.core.files import atomic_path
from raptor.core.jobs import logged, progress
from raptor.moulds.reading import read_at_scale
from raptor.plotting import folding_figure, save
from raptor.studies.tradeoff import Trial

with logged(snakemake.log[0]):
    about = snakemake.params.trial
    trial = Trial.of(about, read_at_scale(snakemake.input.mould[0], about["mould_scale"]))
    lattice = build_lattice(trial.mould, trial.parameters, trial.model)
    methods = ("reference", snakemake.params.method)
    with progress("folding", len(methods)) as advance:
        tissues = {}
        for method in methods:
            tissues[method] = trial.simulate(method)
            advance(method)
    shares = {name: inverted_share(s.positions, lattice) for name, s in tissues.items()}
    save(folding_figure(tissues, shares, trial.mould), Path(snakemake.output.png).with_suffix(""))
    parts = [
        pd.DataFrame(s.positions, columns=["x", "y", "z"]).assign(method=name, inverted=shares[name])
        for name, s in tissues.items()
    ]
    with atomic_path(Path(snakemake.output.data)) as path:
        pd.concat(parts).to_csv(path, index=False, float_format="%.5g")
