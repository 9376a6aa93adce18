"""Blocks of typed keys: what configurations and tissue files are made of, and faults as sentences."""

import hashlib
import json
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from raptor.core.errors import RaptorError
from raptor.core.files import decoded

Name = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")]
Positive = Annotated[int, Field(ge=1)]
Weight = Annotated[float, Field(ge=0)]


class Block(BaseModel):
    """A block of keys: unknown keys are errors, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def content_hash(content: Any) -> str:
    """Short hash of anything that JSON can hold."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def read_yaml(path: Path) -> dict[str, Any]:
    """The keys of a YAML file, or a RaptorError that says why there are none."""
    try:
        content = yaml.safe_load(decoded(path.read_bytes(), str(path)))
    except OSError as error:
        raise RaptorError(f"{path} cannot be read: {error.strerror}; check the path") from error
    except yaml.YAMLError as error:
        raise RaptorError(f"{path} is not YAML: {' '.join(str(error).split())}") from error
    if not isinstance(content, dict):
        raise RaptorError(f"{path} holds no keys; see config/README.md for what it may hold")
    return content


def explain(error: ValidationError, where: str, model: type[BaseModel]) -> Iterator[str]:
    """A sentence for each fault; an unknown key is named with its nearest known one."""
    for fault in error.errors():
        place = ".".join(str(part) for part in fault["loc"])
        if fault["type"] == "extra_forbidden":
            known = _keys_beside(model, fault["loc"])
            near = get_close_matches(str(fault["loc"][-1]), known, 1)
            hint = f"did you mean '{near[0]}'?" if near else f"known are {', '.join(known)}"
            yield f"{where}: unknown key '{place}'; {hint}"
        else:
            message = fault["msg"].removeprefix("Value error, ")
            given = f" (given: {fault['input']!r})" if fault["type"] != "value_error" else ""
            yield f"{where}: {place + ': ' if place else ''}{message}{given}"


def _keys_beside(model: type[BaseModel], place: tuple[int | str, ...]) -> list[str]:
    """Names of the keys that may stand where an unknown one was found."""
    entry = False  # whether the next part is the name of a mapping's entry
    for part in place[:-1]:
        if entry or isinstance(part, int):  # an item of a list or mapping: its model is known already
            entry = False
            continue
        annotation = model.model_fields[part].annotation
        entry = get_origin(annotation) is dict
        block = next((inner for inner in get_args(annotation) if isinstance(inner, type)), annotation)
        if not (isinstance(block, type) and issubclass(block, BaseModel)):
            return []
        model = block
    return list(model.model_fields)
