"""Reading of YAML files, and faults of validation as sentences."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from raptor.config.configuration import Configuration
from raptor.core.blocks import explain, read_yaml
from raptor.core.errors import RaptorError
from raptor.core.files import read_json
from raptor.moulds.cast import cast_sites, central_section
from raptor.moulds.library.tissues import MeasuredTissue, load_tissues
from raptor.moulds.reading import read_at_scale
from raptor.optimisation.spec import others, read_spec


def parse(content: Any, where: str, folders: Sequence[Path] = ()) -> Configuration:
    """Validate a configuration; its paths are found in `folders`, those of its files, then in this folder.

    Raises
    ------
    RaptorError
        One sentence per fault; an unknown key is named with its nearest known one.
    """
    try:
        found = Configuration.model_validate(content)
    except ValidationError as error:
        raise RaptorError("; ".join(explain(error, where, Configuration))) from None
    return _with_paths(found, folders)


def load(path: Path) -> Configuration:
    """Read and validate a configuration file."""
    return parse(read_yaml(Path(path)), str(path), [Path(path).parent])


def _with_paths(configuration: Configuration, folders: Sequence[Path]) -> Configuration:
    """The configuration, with paths of moulds and tissues as seen from the current folder."""
    campaigns = dict(configuration.campaigns)
    for name, campaign in campaigns.items():
        if campaign.kind is None and campaign.repeat_of is None:
            given = campaign.moulds
            paths = (
                _found(given, folders) if isinstance(given, str) else tuple(_found(m, folders) for m in given)
            )
            campaigns[name] = campaign.model_copy(update={"moulds": paths})
    cases = {
        name: case.model_copy(update={"mould": _found(case.mould, folders)})
        for name, case in configuration.tradeoff.cases.items()
    }
    fit = configuration.fit
    if fit.tissues_file is not None:
        fit = fit.model_copy(update={"tissues_file": _found(fit.tissues_file, folders)})
    tradeoff = configuration.tradeoff.model_copy(update={"cases": cases})
    searches = {name: _found(path, folders) for name, path in configuration.searches.items()}
    trained = configuration.trained_model
    if trained not in (None, "shipped"):
        trained = _found(trained, folders)
    changed = {"campaigns": campaigns, "tradeoff": tradeoff, "fit": fit, "searches": searches}
    return configuration.model_copy(update=changed | {"trained_model": trained})


def _found(name: str, folders: Sequence[Path]) -> str:
    """A path in the first of `folders` that has it; as given where it is the same in the current folder."""
    here = Path(name)
    for beside in (Path(folder) / name for folder in folders):
        if beside.exists():
            if here.exists() and here.samefile(beside):
                return name
            path = Path(os.path.normpath(beside.absolute()))
            return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)
    return name


def checked(
    content: Any, where: str, folders: Sequence[Path] = ()
) -> tuple[Configuration, dict[str, MeasuredTissue]]:
    """A run's configuration, as by `parse`, and the tissues that it fits, with every mould that they name.

    Raises
    ------
    RaptorError
        If a key, a tissue or a mould cannot be used.
    """
    configuration = parse(content, where, folders)
    require_castable(configuration)
    for name, path in configuration.searches.items():
        try:
            others(read_spec(path).compare)
        except RaptorError as error:
            raise RaptorError(f"searches.{name}: {error}") from error
    require_usable(configuration)
    fit = configuration.fit
    tissues = load_tissues(fit.tissues_file, fit.tissues if configuration.has_surrogate else ())
    require_measurable(tissues, configuration.mould_scale)
    return configuration, tissues


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
        cast_sites(read_at_scale(case.mould, configuration.mould_scale), 1)


def require_usable(configuration: Configuration) -> None:
    """Check before any work that a trained model is there, and made for the configuration's tissues.

    Raises
    ------
    RaptorError
        If it is not.
    """
    if configuration.trained_folder is None:
        return
    model = read_json(configuration.trained_folder / "model.json")
    for key in ("layers", "pixels"):
        if model[key] != getattr(configuration, key):
            raise RaptorError(
                f"{key} is {getattr(configuration, key)}, but trained_model was made for {model[key]}; set "
                f"{key}: {model[key]}"
            )


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
