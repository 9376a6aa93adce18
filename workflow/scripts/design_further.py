"""Choose the runs and moulds of a further set."""

from pathlib import Path

from raptor.config import parse
from raptor.core.jobs import logged
from raptor.dataset.design import read_design, write_design
from raptor.dataset.further import further_set
from raptor.moulds import moulds_by_id, write_moulds

with logged(snakemake.log[0]):
    configuration = parse(snakemake.params.dump, "configuration")
    runs, moulds = further_set(
        snakemake.wildcards.set,
        snakemake.params.size,
        read_design(Path(snakemake.input.design)),
        moulds_by_id(Path(snakemake.input.moulds)),
        configuration.design_rules(),
        configuration.random_moulds(),
        configuration.seed,
        configuration.further.seeds,
    )
    write_design(Path(snakemake.output.design), runs)
    write_moulds(Path(snakemake.output.moulds), moulds)
