"""How kernels are compiled: the one place for Numba's flags and cache.

Arithmetic is strict: no flag lets the compiler reorder a sum or fuse a product. Each compiled kernel
contains copies of the kernels that it calls, compiled again in their new context, and of several copies of
one name a process runs the first that it meets. Strict copies give the same bits. Under fast-math flags
they did not, and a result depended on what had been compiled, loaded or called before.
"""

import fcntl
import hashlib
import logging
import os
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator


def source_hash() -> str:
    """Hash of all the package's kernel sources, on which compiled code and results depend."""
    package = Path(__file__).parents[1]
    kernels = ("core/compiled.py", "raster.py", "condor/*.py")
    sources = [path for pattern in kernels for path in sorted(package.glob(pattern))]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]


def cache_folder() -> Path:
    """Folder of compiled kernels in NUMBA_CACHE_DIR, XDG_CACHE_HOME or ~/.cache, named by `source_hash`.

    Numba does not notice an edited helper in another file and would run the stale one; a folder named by
    the hash of all kernel sources cannot be stale. Numba separates processors within it.
    """
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(chosen) / source_hash()
    try:
        caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:  # a user without a home
        caches = Path(os.devnull)
    return caches / "raptor" / "kernels" / source_hash()


CACHE_FOLDER = cache_folder()


class _Locator(UserProvidedCacheLocator):
    """The one folder, even if it is read-only or cannot be made."""

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> "_Locator":
        return cls(function, file)

    def get_cache_path(self) -> str:
        return str(CACHE_FOLDER)

    def ensure_cache_path(self) -> None:
        CACHE_FOLDER.mkdir(parents=True, exist_ok=True)


class _CacheImpl(CompileResultCacheImpl):
    _locator_classes: list[type[object]] = [_Locator]  # noqa: RUF012, declared so by Numba


class _Cache(FunctionCache):
    """Numba's cache, shared by processes, and bypassed if a file cannot be read or written."""

    _impl_class = _CacheImpl

    def load_overload(self, signature: Any, target: Any) -> Any:
        try:
            return super().load_overload(signature, target)
        except (OSError, EOFError, pickle.UnpicklingError):
            return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        try:
            with _locked(CACHE_FOLDER):
                super().save_overload(signature, compiled)
        except OSError as error:
            _warn_once(error.strerror)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Lock out other processes: two that save a kernel for two types at once corrupt Numba's index."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


@cache
def _warn_once(reason: str) -> None:
    logging.getLogger(__name__).warning(
        "compiled kernels cannot be stored in %s (%s), so each process compiles them again (about 10 s); "
        "set NUMBA_CACHE_DIR to a writable folder",
        CACHE_FOLDER,
        reason,
    )


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a hot loop: no checks, no Python, cached on disk, lets other threads run."""
    compiled: Any = numba.njit(nogil=True, error_model="numpy")(function)
    if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        compiled._cache = _Cache(function)
    return compiled  # type: ignore[no-any-return]
