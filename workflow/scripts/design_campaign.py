"""Make the table and the moulds of a campaign."""

from pathlib import Path

from raptor.core.jobs import logged, progress
from raptor.dataset.campaign import CANDIDATES, Design
from raptor.dataset.design import read_design, write_design
from raptor.moulds import moulds_by_id, write_moulds

with logged(snakemake.log[0]):
    design, base, score = Design.model_validate(snakemake.params.design), None, None
    if snakemake.input.repeated:
        table, moulds = map(Path, snakemake.input.repeated)
        base = read_design(table), moulds_by_id(moulds)
    if snakemake.input.model:  # only a selection by a model needs torch
        from raptor.studies.active_learning import disagreement_of
        from raptor.surrogate.files import load

        score = disagreement_of(load(Path(snakemake.input.model[0]).parent))
    candidates = CANDIDATES * design.campaign.runs if score else 0
    with progress("candidates", candidates) as advance:
        runs, drawn = design.make(base, score, lambda number: advance(f"candidate {number}"))
    write_design(Path(snakemake.output.design), runs)
    write_moulds(Path(snakemake.output.moulds), drawn)
