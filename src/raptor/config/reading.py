"""Reading of YAML files, and faults of validation as sentences."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from raptor.config.configuration import Configuration
from raptor.config.sweep import Sweep
from raptor.config.tradeoff import TradeoffCase
from raptor.core.blocks import explain, read_yaml
from raptor.core.errors import RaptorError
from raptor.moulds.cast import cast_sites, central_section
from raptor.moulds.library.tissues import MeasuredTissue
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
        cast_sites(read_mould(case.mould), 1)
    for mould in sweep.moulds:
        cast_sites(read_mould(mould).scaled(sweep.mould_scale), 1)


def require_measurable(tissues: Mapping[str, MeasuredTissue], mould_scale: float) -> None:
    """Find out before any work that the moulds of tissues can be cast, and their widths measured.

    Raises
    ------
    RaptorError
        Where one cannot.
    """
    for name, tissue in tissues.items():
        mould = read_mould(tissue.mould).scaled(mould_scale)
        cast_sites(mould, 1)
        if tissue.width_ratio is not None and not central_section(mould).intersects(mould.depression):
            raise RaptorError(
                f"tissue {name}: a width ratio is given, but tethers fill the central section of "
                f"{tissue.mould}; leave the width out or change the mould"
            )
