"""Check the data set; name every fault."""

from pathlib import Path

from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path
from raptor.core.jobs import logged
from raptor.dataset.check import check

with logged(snakemake.log[0]):
    faults = check(Path(snakemake.params.folder), snakemake.params.part)
    if faults:
        raise RaptorError("; ".join(faults))
    with atomic_path(Path(snakemake.output.checked)) as path:
        path.write_text("no faults\n")
