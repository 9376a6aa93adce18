"""Common parts of long-running jobs: a log file, a progress bar, errors in one sentence, a lock."""

import logging
import os
import socket
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from raptor.core.errors import RaptorError

log = logging.getLogger("raptor")

Item = TypeVar("Item")
Answer = TypeVar("Answer")


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
def progress(what: str, total: int | None) -> Iterator[Callable[[str], None]]:
    """Show a bar on a terminal; gives a function that advances it and logs what was done.

    Without a total, the bar shows the time that has passed instead of the time left.
    """
    console = Console(stderr=True)
    known = (MofNCompleteColumn(), TimeRemainingColumn()) if total is not None else (TimeElapsedColumn(),)
    columns = (TextColumn("{task.description}"), BarColumn(), *known, TextColumn("{task.fields[note]}"))
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        task = bar.add_task(what, total=total, note="")

        def advance(note: str) -> None:
            log.info("%s: %s", what, note)
            bar.update(task, advance=1, note=note)

        yield advance


def processors() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0))


def in_threads(
    answer: Callable[[Item], Answer], items: Iterable[Item], threads: int | None = None
) -> Iterator[Answer]:
    """Answers to items, in their order, by so many threads; None: one for each processor of the process.

    For numpy and torch, which compute without Python's lock, each on one thread.
    """
    with ThreadPoolExecutor(threads or processors()) as pool:
        yield from pool.map(answer, items)


def hold_lock(path: Path, what: str) -> None:
    """Keep others from doing `what` until this process ends, in whichever way.

    The system drops the lock with the process, so none is left behind by one that was killed.

    Raises
    ------
    RaptorError
        If another process holds it, or its folder cannot be written.
    """
    import fcntl  # not on Windows

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)  # closed with the process; jobs do not inherit it
    except OSError as error:
        raise RaptorError(
            f"{path} cannot be written: {error.strerror}; results need a folder of yours"
        ) from error
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        holder = os.read(file, 200).decode(errors="replace").strip()
        os.close(file)
        raise RaptorError(
            f"{what} is being made by {holder or 'another run'}; wait until that run ends, or stop it, and "
            "give the same command again"
        ) from error
    except OSError as error:  # some network file systems
        log.warning("%s cannot be locked (%s), so start one run at a time", path, error.strerror)
        return
    os.ftruncate(file, 0)
    os.write(file, f"process {os.getpid()} on {socket.gethostname()}\n".encode())
