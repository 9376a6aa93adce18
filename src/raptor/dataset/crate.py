"""RO-Crate of a published folder (profile Workflow Run Crate): which workflow made which files."""

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

from raptor.core.files import write_text
from raptor.core.version import MODEL_VERSION, __version__
from raptor.dataset.croissant import format_of
from raptor.dataset.netcdf import LICENCE_URL

PROFILES = (
    "https://w3id.org/ro/wfrun/process/0.5",
    "https://w3id.org/ro/wfrun/workflow/0.5",
    "https://w3id.org/workflowhub/workflow-ro-crate/1.0",
)
METADATA = "ro-crate-metadata.json"


def write_crate(folder: Path, name: str, sums: Mapping[str, str]) -> Path:
    """Write and return the crate's metadata.

    Parameters
    ----------
    sums : mapping
        SHA-256 by path within the folder.
    """
    from rocrate.model.contextentity import ContextEntity
    from rocrate.rocrate import ROCrate

    crate = ROCrate()
    crate.name = f"RAPTOR data set: {name}"
    crate.description = f"Simulations of tissues in tethered moulds by RAPTOR {__version__}"
    crate.datePublished = datetime.now(UTC).replace(microsecond=0)
    crate.license = crate.add(
        ContextEntity(crate, LICENCE_URL, {"@type": "CreativeWork", "name": "CC BY 4.0"})
    )
    crate.root_dataset["conformsTo"] = [
        crate.add(ContextEntity(crate, profile, {"@type": "CreativeWork", "version": profile.split("/")[-1]}))
        for profile in PROFILES
    ]
    main = "code/Snakefile"
    workflow = crate.add_workflow(folder / main, main, main=True, lang="snakemake")
    workflow["license"] = "https://spdx.org/licenses/MIT"
    workflow["version"] = f"{__version__}, model version {MODEL_VERSION}"
    made = {}
    for file, digest in sums.items():
        if file == main:
            continue
        size = str((folder / file).stat().st_size)
        properties = {"sha256": digest, "contentSize": size, "encodingFormat": format_of(file)}
        made[file] = crate.add_file(folder / file, file, properties=properties)
    given = [entity for file, entity in made.items() if file == "configuration.yaml"]
    results = [entity for file, entity in made.items() if not file.startswith(("code/", "configuration"))]
    times = [(folder / file).stat().st_mtime for file in sums if file.startswith("campaigns/")]
    begun, ended = (
        datetime.fromtimestamp(t, UTC).isoformat(timespec="seconds") for t in (min(times), max(times))
    )
    crate.add_action(
        workflow, object=given, result=results,
        properties={
            "name": f"Run of the workflow with the configuration {name}",
            "startTime": begun, "endTime": ended, "actionStatus": "http://schema.org/CompletedActionStatus",
        },
    )  # fmt: skip
    write_text(folder / METADATA, json.dumps(crate.metadata.generate(), indent=1, default=str) + "\n")
    return folder / METADATA
