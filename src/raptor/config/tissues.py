"""Measured tissues, to be fitted."""

from collections.abc import Mapping
from dataclasses import fields
from difflib import get_close_matches
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic import Field, ValidationError, model_validator

from raptor.condor.lattice import cast_sites
from raptor.config.blocks import Block
from raptor.config.reading import explain, read_yaml
from raptor.core.errors import RaptorError
from raptor.fields.shape import central_section
from raptor.moulds.reading import read_mould
from raptor.parameters import CellParameters


class Tissue(Block):
    """A tissue and the mould it grew in: measured, or known by its delta alone."""

    description: str = Field(description="cells, gel and source of the measurement")
    mould: str = Field(description="mould file, an approximation documented in it")
    area_ratio: float | None = Field(None, gt=0, le=1.5, description="A/A0")
    width_ratio: float | None = Field(None, gt=0, le=1.5, description="w/w0")
    paper: dict[str, float] = Field(default_factory=dict, description="the paper's fit")

    def parameters(self, name: str, given: Mapping[str, float] = MappingProxyType({})) -> CellParameters:
        """The paper's fitted parameters of the tissue called `name`, those `given` instead of its own.

        Raises
        ------
        RaptorError
            Where the paper gives no fit of a parameter that is not given, or a value is out of bounds.
        """
        values = self.paper | dict(given)
        names = [field.name for field in fields(CellParameters)]
        missing = [field for field in names if field not in values]
        if missing:
            raise RaptorError(f"tissue {name} has no fitted {', '.join(missing)}; give a value yourself")
        return CellParameters(**{field: values[field] for field in names})

    @model_validator(mode="after")
    def _measured(self) -> "Tissue":
        if not self.measured and "delta" not in self.paper:
            raise ValueError(
                "neither area_ratio nor width_ratio is given; a fit needs one of them (or, for a tissue to "
                "be simulated and not fitted, the paper's delta)"
            )
        return self

    @property
    def measured(self) -> bool:
        """Whether there is anything to fit."""
        return self.area_ratio is not None or self.width_ratio is not None


def load_tissues(
    path: Path, names: tuple[str, ...] | None = None, mould_scale: float = 1.0
) -> dict[str, Tissue]:
    """Read tissues, all or those named; their moulds are cast and measured at the scale given.

    Raises
    ------
    RaptorError
        Where the file, a tissue in it or its mould cannot be used.
    """
    content = read_yaml(Path(path))
    chosen = {}
    for name in names if names is not None else content:
        chosen[name] = _tissue(content, name, path)
        _require_measurable(chosen[name], name, mould_scale)
    return chosen


def require_measured(tissues: Mapping[str, Tissue], unmeasured: Mapping[str, Tissue]) -> None:
    """Find out before any work that tissues to fit were measured, and that the others have a delta.

    Raises
    ------
    RaptorError
        Where one was not, or has none.
    """
    for name, tissue in tissues.items():
        if not tissue.measured:
            raise RaptorError(
                f"tissue {name} has neither area_ratio nor width_ratio, so it cannot be fitted; name it in "
                "fit.unmeasured instead of fit.tissues"
            )
    for name, tissue in unmeasured.items():
        if "delta" not in tissue.paper:
            raise RaptorError(f"tissue {name} has no paper: {{delta: ...}} to be simulated at; give it one")


def load_tissue(path: Path, name: str) -> Tissue:
    """Read one tissue; its mould is not.

    Raises
    ------
    RaptorError
        Where the file or the tissue in it cannot be used.
    """
    if not Path(path).is_file():
        raise RaptorError(
            f"{path}, in which tissues are described, does not exist; go to the project's folder, or name "
            "another file by --tissues"
        )
    return _tissue(read_yaml(Path(path)), name, path)


def _tissue(content: dict[str, Any], name: str, path: Path) -> Tissue:
    """A tissue of a file's content."""
    if name not in content:
        near = get_close_matches(name, content, 1)
        hint = f"; did you mean '{near[0]}'?" if near else f"; known are {', '.join(content)}"
        raise RaptorError(f"{path} has no tissue '{name}'{hint}")
    try:
        return Tissue.model_validate(content[name])
    except ValidationError as error:
        raise RaptorError("; ".join(explain(error, f"{path}, {name}", Tissue))) from None


def _require_measurable(tissue: Tissue, name: str, scale: float) -> None:
    """Find out before any work that a tissue's mould can be cast, and its width measured."""
    mould = read_mould(Path(tissue.mould)).scaled(scale)
    cast_sites(mould, 1)
    if tissue.width_ratio is not None and not central_section(mould).intersects(mould.depression):
        raise RaptorError(
            f"tissue {name}: a width ratio is given, but tethers fill the central section of "
            f"{tissue.mould}; leave the width out or change the mould"
        )
