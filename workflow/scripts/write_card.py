"""Write the data set card."""

from pathlib import Path

from raptor.core.files import write_text
from raptor.core.jobs import logged
from raptor.dataset.card import card
from raptor.dataset.design import read_design
from raptor.dataset.examples import read_examples
from raptor.dataset.shards import read_shard
from raptor.moulds import read_moulds

with logged(snakemake.log[0]):
    text = card(
        snakemake.params.name,
        read_design(Path(snakemake.input.design)),
        read_moulds(Path(snakemake.input.moulds)),
        (read_shard(Path(shard)) for shard in snakemake.input.shards),
        Path(snakemake.input.stack),
        read_examples(Path(snakemake.input.examples)),
    )
    write_text(Path(snakemake.output.card), text)
