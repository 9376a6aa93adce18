"""Check the data set; name every fault."""

from pathlib import Path

from raptor.dataset.checks import check
from raptor.errors import RaptorError
from raptor.files import atomic_path
from raptor.jobs import logged

with logged(snakemake.log[0]):
    faults = check(Path(snakemake.params.folder), snakemake.params.part)
    if faults:
        raise RaptorError("; ".join(faults))
    with atomic_path(Path(snakemake.output.checked)) as path:
        path.write_text("no faults\n")
