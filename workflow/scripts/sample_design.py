"""Draw the design of a data set."""

from pathlib import Path

from raptor.config import parse
from raptor.core.jobs import logged
from raptor.dataset.design import sample_design, write_design
from raptor.moulds import write_moulds

with logged(snakemake.log[0]):
    configuration = parse(snakemake.params.dump, "configuration")
    runs, moulds = sample_design(
        configuration.design_rules(), configuration.random_moulds(), configuration.seed
    )
    write_design(Path(snakemake.output.design), runs)
    write_moulds(Path(snakemake.output.moulds), moulds)
