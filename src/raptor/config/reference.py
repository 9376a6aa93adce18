"""Files generated from the configuration model: JSON schema, defaults, key table."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

import yaml
from pydantic import BaseModel

from raptor.config.configuration import MODELS, Configuration
from raptor.core.errors import RaptorError
from raptor.core.files import write_text

DEFAULTS_HEAD = """\
# The default run: 64 simulations, a surrogate beside the shipped one, and a fit, in about six
# minutes on two cores. All keys have their defaults but trained_model (null), and config/README.md explains
# them. Written by `raptor reference`.
"""
README_HEAD = """# Configuration

Without `--configfile`, `laptop.yaml` is used. A file that you name, as by `--configfile config/paper.yaml`,
takes its place; keys that it leaves out have the defaults below, which are those in `laptop.yaml` but for
`trained_model`. Unknown keys are errors. Paths are found beside the configuration, then in the folder of the
run. Every simulation belongs to an entry of `campaigns`; a new study is one more entry:

```yaml
campaigns:
  my_mould:
    moulds: my_mould.geojson
    grid: {delta: [0.2, 0.5, 0.8], kappa_nnn: [0.5], ratio: [0.6]}
    seeds: 2
```

`workflow/env raptor reference` generates this page and `laptop.yaml` from the configuration model in
`src/raptor`.

"""


def json_schema() -> dict[str, Any]:
    """The JSON schema, as in workflow/schemas."""
    return Configuration.model_json_schema()


def write_reference(root: Path) -> list[Path]:
    """Write the JSON schema, the default configuration and the key table; returns their paths.

    Raises
    ------
    RaptorError
        If the folder is not the project's.
    """
    if not (root / "config").is_dir() or not (root / "workflow").is_dir():
        raise RaptorError(f"{root.resolve()} has no config/ and workflow/; give the project's folder")
    defaults = yaml.safe_dump(stated_defaults(), sort_keys=False, default_flow_style=None, width=100)
    contents = {
        "workflow/schemas/config.schema.json": json.dumps(json_schema(), indent=1) + "\n",
        "config/laptop.yaml": DEFAULTS_HEAD + defaults,
        "config/README.md": README_HEAD + key_table(),
    }
    for name, content in contents.items():
        write_text(root / name, content)
    return [root / name for name in contents]


def stated_defaults() -> dict[str, Any]:
    """The default run; for campaigns and models only what differs from their defaults."""
    # Any layers and pixels go without the shipped surrogate, so it is no default.
    content = Configuration(trained_model="shipped", models=MODELS).model_dump(mode="json")
    for name in ("campaigns", "models"):
        block = _block_of(name)
        assert block is not None
        plain = {key: entry.default for key, entry in block.model_fields.items()}
        like = plain
        for entry, values in content[name].items():
            content[name][entry] = {key: value for key, value in values.items() if value != _plain(like[key])}
            like = values if name == "models" and like is plain else like
    return content


def key_table() -> str:
    """The table of keys in config/README.md, in Markdown; NAME stands for the name of an entry."""
    rows = ["| key | default | meaning |", "| --- | --- | --- |"]
    defaults = Configuration()
    for name, entry in Configuration.model_fields.items():
        block, value = _block_of(name), getattr(defaults, name)
        if block is None:
            rows.append(_row(name, value, entry.description))
            continue
        entries = isinstance(value, Mapping)
        if entries:
            rows.append(_row(name, list(value), entry.description))
        for key, inner in block.model_fields.items():
            given = inner.get_default(call_default_factory=True) if entries else getattr(value, key)
            rows.append(_row(f"{name}.NAME.{key}" if entries else f"{name}.{key}", given, inner.description))
    return "\n".join(rows) + "\n"


def _block_of(name: str) -> type[BaseModel] | None:
    """The block of a key, or of each of its entries; None for a plain value."""
    annotation = Configuration.model_fields[name].annotation
    kinds = (annotation, *get_args(annotation))
    return next((kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)), None)


def _row(name: str, value: Any, description: str | None) -> str:
    text = json.dumps(_plain(value))
    return f"| `{name}` | `{text}` | {description} |"


def _plain(value: Any) -> Any:
    """A value in the types of JSON; entries as their names."""
    if isinstance(value, Mapping):
        return list(value)
    return list(value) if isinstance(value, tuple) else value
