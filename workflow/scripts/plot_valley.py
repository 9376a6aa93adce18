"""Draw what two ratios leave open of three parameters."""

import json
from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path
from raptor.core.jobs import logged
from raptor.plotting import save, valley_figure

with logged(snakemake.log[0]):
    fit, posterior = (json.loads(Path(snakemake.input[name]).read_text()) for name in ("fit", "posterior"))
    tables = [pd.read_csv(snakemake.input[name]) for name in ("points", "draws", "further")]
    marks = {"surrogate's fit": fit["surrogate"]["parameters"], "paper's fit": fit["paper"]}
    known = {name: mark for name, mark in marks.items() if {"delta", "kappa_nnn"} <= mark.keys()}
    save(valley_figure(*tables, posterior, known), Path(snakemake.output.png).with_suffix(""))
    with atomic_path(Path(snakemake.output.data)) as path:
        tables[0].to_csv(path, index=False)
