"""Draw the twelve held-out cases whose density is predicted worst."""

from pathlib import Path

import pandas as pd

from raptor.core.jobs import logged
from raptor.dataset.stack import read_samples, read_table
from raptor.moulds import moulds_by_id
from raptor.plotting import save, save_fields, worst_figure
from raptor.studies.evaluation import worst
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    stack, chosen = Path(snakemake.input.stack), worst(pd.read_csv(snakemake.input.metrics))
    row_of = {number: row for row, number in enumerate(read_table(stack).simulation.tolist())}
    moulds = moulds_by_id(Path(snakemake.input.moulds), set(chosen["mould"]))
    surrogate = load(Path(snakemake.input.weights).parent)
    cases, stacks = [], {}
    samples = read_samples(stack, [row_of[number] for number in chosen["simulation"]])
    for sample, error in zip(samples, chosen["vrmse_density"], strict=True):
        p = sample.parameters
        predicted = surrogate.predict(moulds[sample.mould], [p])[0]
        title = (
            f"{sample.mould}: VRMSE {error:.2f}\n$\\Delta$ {p.delta:.2f}, "
            f"$\\kappa$ {p.kappa_nnn:.2f}, {p.kappa_nnnn:.2f}"
        )
        cases.append((title, moulds[sample.mould], sample.fields[0], predicted[0]))
        stacks |= {f"{sample.mould}_simulation": sample.fields, f"{sample.mould}_prediction": predicted}
    save(worst_figure(cases), Path(snakemake.output.png).with_suffix(""))
    save_fields(Path(snakemake.output.data), stacks)
