"""Reading of YAML files, and faults of validation as sentences."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from raptor.config.configuration import Configuration
from raptor.core.blocks import explain, read_yaml
from raptor.core.errors import RaptorError
from raptor.moulds.cast import cast_sites, central_section
from raptor.moulds.library.tissues import MeasuredTissue
from raptor.moulds.reading import read_at_scale, read_mould


def parse(content: Any, where: str) -> Configuration:
    """Validate a configuration.

    Raises
    ------
    RaptorError
        One sentence per fault; an unknown key is named with its nearest known one.
    """
    try:
        return Configuration.model_validate(content)
    except ValidationError as error:
        raise RaptorError("; ".join(explain(error, where, Configuration))) from None


def load(path: Path) -> Configuration:
    """Read and validate a configuration file."""
    return parse(read_yaml(Path(path)), str(path))


def require_castable(configuration: Configuration) -> None:
    """Check before any work that every named mould can be read and cast.

    Raises
    ------
    RaptorError
        If one cannot.
    """
    for name, campaign in configuration.campaigns.items():
        try:
            for path in campaign.files().values():
                cast_sites(read_at_scale(path, configuration.mould_scale), 1)
        except RaptorError as error:
            raise RaptorError(f"campaigns.{name}: {error}") from error
    for case in configuration.tradeoff.cases.values():
        cast_sites(read_mould(case.mould), 1)


def require_measurable(tissues: Mapping[str, MeasuredTissue], mould_scale: float) -> None:
    """Check before any work that the moulds of tissues can be cast, and their widths measured.

    Raises
    ------
    RaptorError
        If one cannot.
    """
    for name, tissue in tissues.items():
        if not tissue.measured:
            raise RaptorError(
                f"tissue {name} has neither area_ratio nor width_ratio, so it cannot be fitted; simulate it "
                f"as a campaign, with moulds: [{tissue.mould}]"
            )
        mould = read_at_scale(tissue.mould, mould_scale)
        cast_sites(mould, 1)
        if tissue.width_ratio is not None and not central_section(mould).intersects(mould.depression):
            raise RaptorError(
                f"tissue {name}: a width ratio is given, but tethers fill the central section of "
                f"{tissue.mould}; omit the width or change the mould"
            )
