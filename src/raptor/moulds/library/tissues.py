"""Measured tissues and their moulds (paper, "A summary of widths and areas")."""

from collections.abc import Mapping
from dataclasses import fields
from difflib import get_close_matches
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic import Field, ValidationError, model_validator

from raptor.core.blocks import Block, explain, read_yaml
from raptor.core.errors import RaptorError
from raptor.moulds.library import TISSUES
from raptor.parameters import CellParameters


class MeasuredTissue(Block):
    """A tissue and its mould: measured, or known by its delta alone."""

    description: str = Field(description="cells, gel and source of the measurement")
    mould: str = Field(description="a library mould by name, or a mould file beside this one")
    area_ratio: float | None = Field(None, gt=0, le=1.5, description="A/A0")
    width_ratio: float | None = Field(None, gt=0, le=1.5, description="w/w0")
    paper: dict[str, float] = Field(default_factory=dict, description="the paper's fit")

    def parameters(self, name: str, given: Mapping[str, float] = MappingProxyType({})) -> CellParameters:
        """The paper's fitted parameters of the tissue called `name`, overridden by those `given`.

        Raises
        ------
        RaptorError
            If a parameter is neither given nor fitted in the paper, or a value is out of bounds.
        """
        values = self.paper | dict(given)
        names = [field.name for field in fields(CellParameters)]
        missing = [field for field in names if field not in values]
        if missing:
            raise RaptorError(f"tissue {name} has no fitted {', '.join(missing)}; give a value yourself")
        return CellParameters(**{field: values[field] for field in names})

    @property
    def fit(self) -> CellParameters:
        """The paper's fitted parameters.

        Raises
        ------
        RaptorError
            If the paper does not give all of them.
        """
        return self.parameters(self.description)

    @model_validator(mode="after")
    def _measured(self) -> "MeasuredTissue":
        if not self.measured and "delta" not in self.paper:
            raise ValueError(
                "neither area_ratio nor width_ratio is given; a fit needs one of them (or the paper's delta, "
                "for a tissue to be simulated and not fitted)"
            )
        return self

    @property
    def measured(self) -> bool:
        """Whether a ratio was measured."""
        return self.area_ratio is not None or self.width_ratio is not None


def load_tissues(
    path: str | Path | None = None, names: tuple[str, ...] | None = None
) -> dict[str, MeasuredTissue]:
    """Read tissues, all or those named, from the library or another file, without their moulds.

    Raises
    ------
    RaptorError
        If the file or a tissue in it cannot be used.
    """
    path = Path(path or TISSUES)
    content = read_yaml(path)
    return {name: _tissue(content, name, path) for name in (content if names is None else names)}


def tissue(name: str, path: str | Path | None = None) -> MeasuredTissue:
    """A measured tissue by name, of the library or of another file.

    Raises
    ------
    RaptorError
        If the file or the tissue in it cannot be used.
    """
    return load_tissues(path, (name,))[name]


def _tissue(content: dict[str, Any], name: str, path: Path) -> MeasuredTissue:
    """A tissue of a file's content."""
    if name not in content:
        near = get_close_matches(name, content, 1)
        hint = f"; did you mean '{near[0]}'?" if near else f"; known are {', '.join(content)}"
        raise RaptorError(f"{path} has no tissue '{name}'{hint}")
    try:
        found = MeasuredTissue.model_validate(content[name])
    except ValidationError as error:
        raise RaptorError("; ".join(explain(error, f"{path}, {name}", MeasuredTissue))) from None
    beside = path.parent / found.mould
    return found.model_copy(update={"mould": str(beside)}) if beside.is_file() else found
