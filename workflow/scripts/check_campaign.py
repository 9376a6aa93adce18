"""Check a campaign and list every fault."""

from pathlib import Path

from raptor.core.errors import RaptorError
from raptor.core.files import write_text
from raptor.core.jobs import logged
from raptor.dataset.check import check_campaign

with logged(snakemake.log[0]):
    path = Path(snakemake.output.checked)
    faults = list(check_campaign(path.parent, snakemake.params.fraction))
    if faults:
        raise RaptorError("; ".join(faults))
    write_text(path, "no faults\n")
