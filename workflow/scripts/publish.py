"""Make the published folder of a run."""

from pathlib import Path

from raptor.core.jobs import logged
from raptor.dataset.publish import publish

with logged(snakemake.log[0]):
    folder = Path(snakemake.output.manifest).parent
    model = {Path(path).name: Path(path) for path in snakemake.input.model}
    if "card.md" in model:  # the name that hubs read
        model["README.md"] = model.pop("card.md")
    publish(folder, folder.parent, snakemake.params.campaigns, model, Path(snakemake.params.code))
