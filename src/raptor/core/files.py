"""Files are read with clear errors and written atomically: whole or not at all."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from raptor.core.errors import RaptorError


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; on success it is flushed to disk and renamed to `path`.

    Two writers of one file do no harm: each has its own temporary file.

    Raises
    ------
    RaptorError
        If the disk is full or the folder cannot be written.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    except RaptorError:
        raise
    except Exception as error:
        # netCDF and torch report a full disk as their own kinds of error.
        full = getattr(error, "errno", None) in (errno.ENOSPC, errno.EDQUOT) or _is_full(path.parent)
        if full:
            raise RaptorError(
                f"no room left on the disk for {path}; free some space and run the same command "
                "again: finished files are kept"
            ) from error
        if isinstance(error, OSError):
            raise RaptorError(f"{path} cannot be written: {error}") from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def read_input(path: Path, what: str, expected: str) -> bytes:
    """Content of a user's file; messages call it `what` and say what is `expected` in it.

    Raises
    ------
    RaptorError
        If it does not exist, is a folder, cannot be read or is empty.
    """
    path = Path(path)
    if path.is_dir():
        raise RaptorError(f"{what} {path} is a folder; give a file")
    if not path.is_file():
        raise RaptorError(f"{what} {path} does not exist; check the path")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise RaptorError(f"{what} {path} cannot be read: {error.strerror}") from error
    if not content.strip():
        raise RaptorError(f"{what} {path} is empty; {expected} is expected")
    return content


def _is_full(folder: Path) -> bool:
    """Whether the disk is full; libraries such as HDF5 do not report it."""
    try:
        status = os.statvfs(folder)
    except OSError:
        return False
    return status.f_bavail * status.f_frsize < 64 * 1024
