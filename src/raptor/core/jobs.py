"""Common parts of long-running jobs: a log file, a progress bar, errors in one sentence."""

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from raptor.core.errors import RaptorError

log = logging.getLogger("raptor")


@contextmanager
def logged(path: Path | str) -> Iterator[None]:
    """Log a job to a file; a RaptorError ends it with its sentence and exit status 1."""
    handler = logging.FileHandler(path, mode="w")
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    try:
        yield
    except RaptorError as error:
        log.error("%s", error)
        sys.stderr.write(f"error: {error}\n")
        raise SystemExit(1) from error
    except Exception:
        log.exception("the job failed")
        raise
    finally:
        log.removeHandler(handler)
        handler.close()


@contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[str], None]]:
    """Show a bar on a terminal; gives a function that advances it and logs what was done."""
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
    )  # fmt: skip
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        task = bar.add_task(what, total=total, note="")

        def advance(note: str) -> None:
            log.info("%s: %s", what, note)
            bar.update(task, advance=1, note=note)

        yield advance
