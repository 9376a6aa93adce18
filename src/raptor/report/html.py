"""The report: one self-contained HTML file with every figure and number of a run.

The text is a Jinja template; this module gives it the run's files and formats numbers.
"""

import base64
import math
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import jinja2
import pandas as pd
import yaml

from raptor.core.errors import RaptorError
from raptor.core.files import read_json, write_text
from raptor.core.version import MODEL_VERSION, __version__
from raptor.dataset.netcdf import REFERENCES

READERS: dict[str, Callable[[Path], Any]] = {
    ".csv": lambda path: pd.read_csv(path).to_dict("records"),
    ".json": read_json,
    ".yaml": lambda path: yaml.safe_load(path.read_text(encoding="utf-8")),
    ".md": lambda path: path.read_text(encoding="utf-8"),
}
"""Readers of a run's tables and texts, by suffix."""
NOTHING = "\N{EN DASH}"
"""Shown in place of a missing number."""
LARGE = 2**22  # bytes; larger tables are not shown


def write_report(path: Path, template: Path, folder: Path, files: Iterable[Path]) -> None:
    """Write the report of the run in `folder` from the template and the given files of the run.

    Parts of the text whose files are not given are left out.

    Raises
    ------
    RaptorError
        If the template or a file cannot be read, or the template asks for a missing name.
    """
    given = [Path(file) for file in files]
    figures = {file.stem: picture(file) for file in given if file.suffix == ".png"}
    known = [file for file in given if file.suffix in READERS and file.is_relative_to(folder)]
    tables = {
        file.relative_to(folder).as_posix(): _read(file) for file in known if file.stat().st_size < LARGE
    }
    try:
        text = render(template.read_text(encoding="utf-8"), {"figures": figures, "files": tables})
    except OSError as error:
        raise RaptorError(f"template {template} cannot be read: {error}") from error
    except jinja2.TemplateError as error:
        raise RaptorError(f"template {template}: {error}") from error
    write_text(path, text)


def render(template: str, content: Mapping[str, Any], *, escape: bool = True) -> str:
    """A rendered template; a name that `content` does not have is an error.

    With `escape`, values are escaped for HTML. Filters: `number` and `percent` (both take digits), `section`
    of a Markdown text.
    """
    environment = jinja2.Environment(
        autoescape=escape, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {"number": number, "percent": percent, "section": section}
    versions = {"version": __version__, "model_version": MODEL_VERSION, "references": REFERENCES}
    return environment.from_string(template).render(versions | dict(content))


def picture(path: Path) -> str:
    """A PNG as a data URI.

    Raises
    ------
    RaptorError
        If it cannot be read.
    """
    try:
        content = base64.b64encode(path.read_bytes()).decode("ascii")
    except OSError as error:
        raise RaptorError(f"figure {path} cannot be read: {error}") from error
    return f"data:image/png;base64,{content}"


def number(value: Any, digits: int = 2) -> str:
    """A number to some significant digits, with thousands separated; a dash if missing."""
    if value is None or isinstance(value, str) or not math.isfinite(value):
        return str(value) if isinstance(value, str) else NOTHING
    if isinstance(value, int):
        return f"{value:,}"
    if value == 0:
        return "0"
    value = float(f"{value:.{digits - 1}e}")
    places = digits - 1 - math.floor(math.log10(abs(value)))
    if places > digits + 3:
        return f"{value:.{digits - 1}e}"
    return f"{value:,.{max(0, places)}f}"


def percent(share: Any, digits: int = 0) -> str:
    """A share in per cent; a dash if missing."""
    if share is None or not math.isfinite(share):
        return NOTHING
    return f"{100 * share:.{digits}f} %"


def section(markdown: str, heading: str) -> str:
    """The text under a heading of a Markdown text, up to the next; empty if there is none."""
    found = re.search(rf"^#+ {re.escape(heading)}\n(.*?)(?=^#|\Z)", markdown, re.MULTILINE | re.DOTALL)
    return " ".join(found[1].split()) if found else ""


def _read(path: Path) -> Any:
    """A table or text, by its suffix."""
    try:
        return READERS[path.suffix](path)
    except pd.errors.EmptyDataError:
        return []
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise RaptorError(f"{path} cannot be read: {error}") from error
