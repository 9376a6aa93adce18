"""How kernels are compiled: the one place for Numba's flags and cache."""

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

# contract, arcp and reassoc let loops use vector units; NaN and infinity keep their meaning.
FAST_MATH = {"contract", "reassoc", "nsz", "arcp"}


def source_hash() -> str:
    """Hash of all the package's kernel sources: what compiled code, and so a result, hangs on."""
    package = Path(__file__).parents[1]
    kernels = ("core/compiled.py", "raster.py", "condor/*.py")
    sources = [path for pattern in kernels for path in sorted(package.glob(pattern))]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]


# Numba's cache does not see an edited helper in another file and would run the stale one; a folder
# named by the hash of all kernel sources cannot be stale.
if "NUMBA_CACHE_DIR" not in os.environ:
    _base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    numba.config.CACHE_DIR = str(_base / "raptor" / "kernels" / source_hash())  # type: ignore[attr-defined]


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a hot loop: no checks, no Python, cached on disk, lets other threads run."""
    compiled: Callable[..., Any] = numba.njit(
        cache=True, nogil=True, error_model="numpy", fastmath=FAST_MATH
    )(function)
    return compiled
