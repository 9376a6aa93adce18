"""Write the validated configuration."""

from pathlib import Path

import yaml

from raptor.core.files import atomic_path
from raptor.core.jobs import logged

with logged(snakemake.log[0]), atomic_path(Path(snakemake.output.configuration)) as path:
    path.write_text(yaml.safe_dump(snakemake.params.configuration, sort_keys=False))
