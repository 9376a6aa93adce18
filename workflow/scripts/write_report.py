"""Write the report."""

from pathlib import Path

from raptor.core.jobs import logged
from raptor.report.html import write_report

with logged(snakemake.log[0]):
    path = Path(snakemake.output.report)
    write_report(path, Path(snakemake.input.template), path.parent, map(Path, snakemake.input))
