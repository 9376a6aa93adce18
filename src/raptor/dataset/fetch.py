"""`raptor fetch`: bring a published folder from a path or an address, resuming, and verify every file."""

import http.client
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO
from urllib.error import HTTPError
from urllib.parse import quote
from urllib.request import Request, urlopen

from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path, decoded
from raptor.core.version import __version__
from raptor.dataset.publish import MANIFEST, digest_of, read_manifest

BLOCK = 2**20
TIMEOUT = 60  # seconds without an answer
AGAIN = "give the same command again, which goes on where it stopped"


def fetch(
    source: str, folder: Path, on_progress: Callable[[str, int], None] = lambda name, count: None
) -> int:
    """Copy a published folder, file by file; returns the number of files.

    A file gets its name only when its checksum is right; until then it is `.NAME.part`, where the next call
    goes on. Files that are there already and right are kept. The manifest comes last.

    Parameters
    ----------
    source : str
        Path of a folder that the rule `publish` made, or its http or https address.
    on_progress : callable
        Called with the name of each file that is there, and the number of all.

    Raises
    ------
    RaptorError
        If the source cannot be read, a file differs from its checksum, or the folder holds another file of
        the same name.
    """
    with _opened(source, MANIFEST, 0) as (stream, _):
        manifest = _content(stream, f"{source}/{MANIFEST}")
    sums = read_manifest(decoded(manifest, f"{source}/{MANIFEST}"), f"{source}/{MANIFEST}")
    for name, digest in sums.items():
        _bring(source, name, folder / name, digest)
        on_progress(name, len(sums))
    with atomic_path(folder / MANIFEST) as path:
        path.write_bytes(manifest)
    return len(sums)


def is_address(source: str) -> bool:
    """Whether a source is an address, not a path."""
    return source.startswith(("http://", "https://"))


def _bring(source: str, name: str, target: Path, digest: str) -> None:
    """One file, whole and right, or an error."""
    if target.exists():
        if digest_of(target) == digest:
            return
        raise RaptorError(f"{target} is there already and differs from the source's; choose another --output")
    part = target.with_name(f".{target.name}.part")
    resumed = part.is_file()
    _append(source, name, part)
    if digest_of(part) != digest and resumed:  # the part was of another version
        part.unlink()
        _append(source, name, part)
    if digest_of(part) != digest:
        part.unlink()
        raise RaptorError(
            f"{name} from {source} does not have the checksum in {MANIFEST}: it was changed or damaged "
            "there; ask for a whole copy"
        )
    part.replace(target)


def _append(source: str, name: str, part: Path) -> None:
    """Read the rest of a file that is there in part, or all of it."""
    start = part.stat().st_size if part.is_file() else 0
    try:
        part.parent.mkdir(parents=True, exist_ok=True)
        with _opened(source, name, start) as (stream, goes_on), part.open("ab" if goes_on else "wb") as file:
            for block in _blocks(stream, f"{source}/{name}"):
                file.write(block)
    except OSError as error:
        raise RaptorError(f"{part} cannot be written: {error}; {AGAIN}") from error


@contextmanager
def _opened(source: str, name: str, start: int) -> Iterator[tuple[BinaryIO | http.client.HTTPResponse, bool]]:
    """A file of the source from a byte on, and whether it does begin there rather than anew."""
    if not is_address(source):
        path = Path(source) / name
        if not path.is_file():
            hint = f"; give a folder that the rule publish made, with {MANIFEST}" if name == MANIFEST else ""
            raise RaptorError(f"{path} does not exist{hint}")
        try:
            file = path.open("rb")
        except OSError as error:
            raise RaptorError(f"{path} cannot be read: {error.strerror}") from error
        with file:
            file.seek(start)
            yield file, True
        return
    where = f"{source.rstrip('/')}/{quote(name)}"
    headers = {"User-Agent": f"raptor/{__version__}"} | ({"Range": f"bytes={start}-"} if start else {})
    try:
        response = urlopen(Request(where, headers=headers), timeout=TIMEOUT)
    except HTTPError as error:
        if start and error.code == http.client.REQUESTED_RANGE_NOT_SATISFIABLE:  # all is there, or too much
            with _opened(source, name, 0) as found:
                yield found
            return
        raise RaptorError(
            f"{where} cannot be read: the server answers {error.code} {error.reason}"
        ) from error
    except (OSError, ValueError, http.client.HTTPException) as error:
        raise RaptorError(f"{where} cannot be reached: {getattr(error, 'reason', error)}; {AGAIN}") from error
    with response:
        yield response, response.status == http.client.PARTIAL_CONTENT


def _blocks(stream: BinaryIO | http.client.HTTPResponse, where: str) -> Iterator[bytes]:
    """The rest of a stream in blocks; an error if it ends early."""
    left = getattr(stream, "length", None)
    try:
        while block := stream.read(BLOCK):
            left = None if left is None else left - len(block)
            yield block
    except (OSError, http.client.HTTPException) as error:
        raise RaptorError(f"{where}: the connection broke ({error}); {AGAIN}") from error
    if left:
        raise RaptorError(f"{where}: the connection ended {left} bytes early; {AGAIN}")


def _content(stream: BinaryIO | http.client.HTTPResponse, where: str) -> bytes:
    return b"".join(_blocks(stream, where))
