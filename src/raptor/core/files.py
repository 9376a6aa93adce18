"""Files are read with clear errors and written atomically: whole or not at all."""

import errno
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Any

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
            raise RaptorError(f"{path} cannot be written: {error.strerror or error}") from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text in UTF-8, atomically."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def plain(value: Any) -> Any:
    """A value in the types of JSON: numpy's numbers as Python's, paths as text, NaN and infinity as None."""
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    value = value.item() if hasattr(value, "item") else value
    if isinstance(value, float) and not isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def write_json(path: Path, content: Any) -> None:
    """Write what JSON can hold, atomically."""
    write_text(path, json.dumps(content, indent=1) + "\n")


def read_json(path: Path) -> Any:
    """Content of a JSON file.

    Raises
    ------
    RaptorError
        If it is missing, may not be read, or is not JSON.
    """
    try:
        return json.loads(decoded(Path(path).read_bytes(), str(path)))
    except RaptorError:
        raise
    except OSError as error:
        raise RaptorError(f"{path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise RaptorError(f"{path} is not JSON: {error}") from error


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
    except PermissionError as error:
        raise RaptorError(f"{what} {path} may not be read by this user; ask for permission") from error
    except OSError as error:
        raise RaptorError(f"{what} {path} cannot be read: {error.strerror}") from error
    if not content.strip():
        raise RaptorError(f"{what} {path} is empty; {expected} is expected")
    return content


SIGNATURES = {
    b"\x89PNG": "a PNG picture", b"\xff\xd8\xff": "a JPEG picture", b"II*\0": "a TIFF picture",
    b"MM\0*": "a TIFF picture", b"GIF8": "a GIF picture", b"BM": "a BMP picture", b"RIFF": "a WebP picture",
    b"8BPS": "a Photoshop document", b"%PDF": "PDF", b"%!PS": "PostScript", b"AC10": "a DWG drawing",
    b"0\nSECTION": "a DXF drawing", b"0\r\nSECTION": "a DXF drawing",
    b"PK\3\4": "a ZIP archive or an Office document", b"\x1f\x8b": "a gzip archive", b"CDF": "netCDF",
    b"\x89HDF": "HDF5 or netCDF", b"ZISRAWFILE": "a Zeiss CZI picture",
    b"\xda\xce\xbe\x0a": "a Nikon ND2 file",
    b"p\0\0\0": "a Leica LIF picture", b"{": "JSON", b"<svg": "SVG", b"<?xml": "XML",
    b"<!DOCTYPE html": "HTML", b"<html": "HTML",
}  # fmt: skip
UNKNOWN = "looks like none that is known"
MARKS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
"""Encodings by the mark that a text begins with."""


def kind_of(content: bytes) -> str:
    """What a file's content looks like, as a verb and an object."""
    if content[4:8] == b"ftyp":
        return "looks like HEIC, AVIF or a video"
    start = content.lstrip()
    if start.startswith(b"<?xml") and b"<svg" in content[:4000]:
        return "looks like SVG"
    for signature, kind in SIGNATURES.items():
        if content.startswith(signature) or start.startswith(signature):
            return f"looks like {kind}"
    return UNKNOWN


def why_unreadable(path: Path, error: Exception) -> str:
    """Why a library cannot open a netCDF or HDF5 file that exists; its own message often names no cause."""
    if not os.access(path, os.R_OK):
        return "may not be read by this user; ask for permission"
    if _is_locked(path):
        return "is locked by another process that writes it; wait until that ends, then try again"
    with path.open("rb") as file:
        start = file.read(4096)
    if not start:
        return "is empty"
    if start.startswith((b"\x89HDF", b"CDF")):
        return f"is truncated or damaged ({error}); move it elsewhere, and the workflow makes it again"
    return f"is not netCDF: its content {kind_of(start)}"


def _is_locked(path: Path) -> bool:
    """Whether another process holds a lock on a file, as HDF5 does while it writes."""
    try:
        import fcntl
    except ImportError:  # Windows, where opening a file that is in use fails by itself
        return False
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
    return False


def read_text(path: Path, what: str, expected: str) -> str:
    """Text of a file that a user gives, in UTF-8, or with a mark in UTF-16; otherwise as `read_input`.

    Raises
    ------
    RaptorError
        As `read_input`, and if the text has another encoding.
    """
    return decoded(read_input(path, what, expected), f"{what} {path}")


def decoded(content: bytes, where: str) -> str:
    """Bytes as text, without the mark that some programs put before it; raises where it is not UTF-8."""
    encoding = next((name for mark, name in MARKS.items() if content.startswith(mark)), "utf-8")
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        if (kind := kind_of(content)) != UNKNOWN and content[:1] not in b"{[<":
            raise RaptorError(f"{where} is not text: its content {kind}") from error
        line = content.count(b"\n", 0, error.start) + 1
        likely = content[error.start : error.start + 1].decode("latin-1")
        raise RaptorError(
            f"{where} is not UTF-8 text: line {line} holds the byte 0x{content[error.start]:02x} ('{likely}' "
            "in Latin-1 or Windows-1252); save it again with the encoding UTF-8"
        ) from error


def _is_full(folder: Path) -> bool:
    """Whether the disk is full; libraries such as HDF5 do not report it."""
    try:
        status = os.statvfs(folder)
    except OSError:
        return False
    return status.f_bavail * status.f_frsize < 64 * 1024
