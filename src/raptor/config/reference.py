"""What is generated from the configuration model: JSON schema, defaults, key table."""

import json
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel

from raptor.config import Configuration
from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path

DEFAULTS_HEAD = """# The default: 64 simulations, a surrogate and a fit in about ten minutes on two cores.
# Every key is explained in config/README.md. Written by `raptor reference`.
"""
README_HEAD = """# Configuration

`laptop.yaml` is the default and holds every key; another file, such as `paper.yaml`, states only what
differs and is chosen by `workflow/env snakemake --cores all --configfile config/paper.yaml`. Unknown keys
are errors. Moulds are GeoJSON (`moulds/`), measured tissues stand in `tissues.yaml`.

This table and `laptop.yaml` are generated from the model in `src/raptor/config/` by
`workflow/env raptor reference`.

"""


def json_schema() -> dict[str, Any]:
    """The JSON schema, as it stands in workflow/schemas."""
    return Configuration.model_json_schema()


def write_reference(root: Path) -> list[Path]:
    """Write the JSON schema, the default configuration and the key table; returns their paths.

    Raises
    ------
    RaptorError
        Where the folder is not the project's.
    """
    if not (root / "config").is_dir() or not (root / "workflow").is_dir():
        raise RaptorError(f"{root.resolve()} has no config/ and workflow/; give the project's folder")
    contents = {
        "workflow/schemas/config.schema.json": json.dumps(json_schema(), indent=1) + "\n",
        "config/laptop.yaml": DEFAULTS_HEAD
        + yaml.safe_dump(
            Configuration().model_dump(mode="json"), sort_keys=False, default_flow_style=None, width=100
        ),
        "config/README.md": README_HEAD + key_table(),
    }
    for name, content in contents.items():
        with atomic_path(root / name) as temporary:
            temporary.write_text(content)
    return [root / name for name in contents]


def key_table() -> str:
    """The table of keys in config/README.md, in Markdown."""
    rows = ["| key | default | meaning |", "| --- | --- | --- |"]
    for name, entry in Configuration.model_fields.items():
        block = entry.annotation
        if isinstance(block, type) and issubclass(block, BaseModel):
            defaults = block()
            for key, inner in block.model_fields.items():
                value = json.dumps(defaults.model_dump(mode="json")[key])
                rows.append(f"| `{name}.{key}` | `{value}` | {inner.description} |")
        else:
            rows.append(f"| `{name}` | `{json.dumps(entry.default)}` | {entry.description} |")
    return "\n".join(rows) + "\n"
