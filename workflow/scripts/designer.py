"""Write the page on which one draws a mould and sees what the surrogate predicts."""

from pathlib import Path

from raptor.core.jobs import logged
from raptor.report.designer import write_designer

with logged(snakemake.log[0]):
    write_designer(Path(snakemake.output.page), Path(snakemake.input.weights).parent)
