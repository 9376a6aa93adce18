"""Choose further training simulations where the surrogate's networks disagree most."""

from pathlib import Path

import torch

from raptor.config import parse
from raptor.core.files import atomic_path
from raptor.core.jobs import logged, progress
from raptor.dataset.design import write_design
from raptor.moulds import write_moulds
from raptor.studies.active_learning import enriched
from raptor.surrogate.files import load

with logged(snakemake.log[0]):
    torch.set_num_threads(snakemake.threads)
    configuration = parse(snakemake.params.dump, "configuration")
    candidates = snakemake.params.size * configuration.further.candidates
    with progress("candidates", candidates) as advance:
        runs, moulds, table = enriched(
            load(Path(snakemake.input.weights).parent),
            snakemake.params.size,
            candidates,
            configuration.design_rules(),
            configuration.random_moulds(),
            configuration.seed,
            lambda number: advance(f"candidate {number}"),
        )
    write_design(Path(snakemake.output.design), runs)
    write_moulds(Path(snakemake.output.moulds), moulds)
    with atomic_path(Path(snakemake.output.candidates)) as path:
        table.to_csv(path, index=False)
