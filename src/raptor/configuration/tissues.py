"""Measured tissues, to be fitted."""

from difflib import get_close_matches
from pathlib import Path

from pydantic import Field, ValidationError, model_validator

from raptor.condor.lattice import cast_sites
from raptor.configuration.blocks import Block
from raptor.configuration.reading import explain, read_yaml
from raptor.errors import RaptorError
from raptor.morphology import central_section
from raptor.moulds.reading import read_mould


class Tissue(Block):
    """A tissue that was measured, and the mould it grew in."""

    description: str = Field(description="cells, gel and source of the measurement")
    mould: str = Field(description="mould file, an approximation documented in it")
    area_ratio: float | None = Field(None, gt=0, le=1.5, description="A/A0")
    width_ratio: float | None = Field(None, gt=0, le=1.5, description="w/w0")
    paper: dict[str, float] = Field(default_factory=dict, description="the paper's fit")

    @model_validator(mode="after")
    def _measured(self) -> "Tissue":
        if self.area_ratio is None and self.width_ratio is None:
            raise ValueError("neither area_ratio nor width_ratio is given; a fit needs one of them")
        return self


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
        if name not in content:
            near = get_close_matches(name, content, 1)
            hint = f"; did you mean '{near[0]}'?" if near else f"; known are {', '.join(content)}"
            raise RaptorError(f"{path} has no tissue '{name}'{hint}")
        try:
            chosen[name] = Tissue.model_validate(content[name])
        except ValidationError as error:
            raise RaptorError("; ".join(explain(error, f"{path}, {name}", Tissue))) from None
        _require_measurable(chosen[name], name, mould_scale)
    return chosen


def _require_measurable(tissue: Tissue, name: str, scale: float) -> None:
    """Find out before any work that a tissue's mould can be cast, and its width measured."""
    mould = read_mould(Path(tissue.mould)).scaled(scale)
    cast_sites(mould, 1)
    if tissue.width_ratio is not None and not central_section(mould).intersects(mould.depression):
        raise RaptorError(
            f"tissue {name}: a width ratio is given, but tethers fill the central section of "
            f"{tissue.mould}; leave the width out or change the mould"
        )
