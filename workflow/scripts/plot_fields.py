"""Draw the held-out sample whose density error is the median."""

from pathlib import Path

import pandas as pd

from raptor.core.jobs import logged
from raptor.dataset.stack import read_samples, read_table
from raptor.moulds import moulds_by_id
from raptor.plotting import fields_figure, save, save_fields
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    metrics = pd.read_csv(snakemake.input.metrics).sort_values("vrmse_density")
    simulation = int(metrics["simulation"].iloc[len(metrics) // 2])
    stack = Path(snakemake.input.stack)
    row = read_table(stack).simulation.tolist().index(simulation)
    (sample,) = read_samples(stack, [row])
    moulds = moulds_by_id(Path(snakemake.input.moulds))
    surrogate = load(Path(snakemake.input.weights).parent)
    predicted = surrogate.predict(moulds[sample.mould], [sample.parameters])[0]
    stacks = {"simulation": sample.fields, "prediction": predicted}
    save(fields_figure(stacks, moulds[sample.mould]), Path(snakemake.output.png).with_suffix(""))
    save_fields(Path(snakemake.output.data), stacks)
