"""Write the validated configuration."""

from pathlib import Path

import yaml

from raptor.core.files import write_text
from raptor.core.jobs import logged

with logged(snakemake.log[0]):
    content = yaml.safe_dump(snakemake.params.configuration, sort_keys=False)
    write_text(Path(snakemake.output.configuration), content)
