"""Reading of YAML files, and faults of validation as sentences."""

from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args

import yaml
from pydantic import BaseModel, ValidationError

from raptor.condor.lattice import cast_sites
from raptor.config.configuration import Configuration
from raptor.config.sweep import Sweep
from raptor.config.tradeoff import TradeoffCase
from raptor.core.errors import RaptorError
from raptor.moulds.reading import read_mould


def parse(content: Any, where: str) -> Configuration:
    """Validate a configuration.

    Raises
    ------
    RaptorError
        One sentence a fault; an unknown key is named with its nearest known one.
    """
    try:
        return Configuration.model_validate(content)
    except ValidationError as error:
        raise RaptorError("; ".join(explain(error, where, Configuration))) from None


def load(path: Path) -> Configuration:
    """Read and validate a configuration file."""
    return parse(read_yaml(Path(path)), str(path))


def require_castable(cases: tuple[TradeoffCase, ...], sweep: Sweep) -> None:
    """Find out before any work that the moulds of a comparison and of sweeps can be read and cast.

    Raises
    ------
    RaptorError
        Where a mould cannot.
    """
    for case in cases:
        cast_sites(read_mould(Path(case.mould)), 1)
    for path in sweep.moulds:
        cast_sites(read_mould(Path(path)).scaled(sweep.mould_scale), 1)


def read_yaml(path: Path) -> dict[str, Any]:
    """The keys of a YAML file, or a RaptorError that says why there are none."""
    try:
        content = yaml.safe_load(path.read_text())
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
    for part in place[:-1]:
        if isinstance(part, int):  # an item of a list: its model is known already
            continue
        block = model.model_fields[part].annotation
        block = next((inner for inner in get_args(block) if isinstance(inner, type)), block)
        if not (isinstance(block, type) and issubclass(block, BaseModel)):
            return []
        model = block
    return list(model.model_fields)
