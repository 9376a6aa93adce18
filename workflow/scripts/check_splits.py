"""Check that no mould is in two splits of any campaigns, and list those that are."""

from pathlib import Path

from raptor.core.errors import RaptorError
from raptor.core.files import write_text
from raptor.core.jobs import logged
from raptor.dataset.check import check_splits

with logged(snakemake.log[0]):
    stacks = {Path(stack).parent.name: Path(stack) for stack in snakemake.input.stacks}
    faults = list(check_splits(stacks))
    if faults:
        raise RaptorError("; ".join(faults))
    write_text(Path(snakemake.output.checked), "no faults\n")
