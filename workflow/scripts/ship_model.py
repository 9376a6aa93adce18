"""Write the surrogate for the package: two small files and its card."""

from pathlib import Path

import pandas as pd

from raptor.core.files import read_json, write_text
from raptor.core.jobs import logged
from raptor.report.model_card import model_card
from raptor.surrogate.files import load, read_description, save

with logged(snakemake.log[0]):
    source, target = Path(snakemake.input.weights[0]).parent, Path(snakemake.output.weights).parent
    surrogate, description = load(source), read_description(source)
    save(
        target,
        surrogate,
        {name: description[name] for name in ("training", "torch")},
        description["identity"],
        half=True,
    )
    summary = read_json(Path(snakemake.input.summary[0]))
    card = model_card(
        snakemake.params.model,
        snakemake.params.name,
        surrogate,
        description["training"],
        pd.read_csv(snakemake.input.history[0]),
        {name: summary[name] for name in snakemake.params.campaigns if name in summary},
        pd.read_csv(snakemake.input.regions[0]),
        half=True,
    )
    write_text(Path(snakemake.output.card), card)
