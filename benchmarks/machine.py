"""What this machine can do at most on one core: arithmetic, roots and moves of vector registers."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from raptor.condor.simd import lanes, load, muladd, sqrt, store
from raptor.core.compiled import kernel

REPEATS = 5


def seconds(work: Callable[[], Any], least: float = 0.05) -> float:
    """Seconds of one call: the best of some repeats, each of many calls where they are short."""
    work()
    started = time.perf_counter()
    work()
    calls = max(1, int(least / max(1e-9, time.perf_counter() - started)))
    best = np.inf
    for _ in range(REPEATS):
        started = time.perf_counter()
        for _ in range(calls):
            work()
        best = min(best, (time.perf_counter() - started) / calls)
    return float(best)


@kernel
def _arithmetic(array, times):
    """Eight independent chains of multiply-and-add."""
    w = array.size // 9
    x = load(array, 0)
    a, b, c, d = load(array, w), load(array, 2 * w), load(array, 3 * w), load(array, 4 * w)
    e, f, g, h = load(array, 5 * w), load(array, 6 * w), load(array, 7 * w), load(array, 8 * w)
    for _ in range(times):
        a, b, c, d = muladd(a, x, x), muladd(b, x, x), muladd(c, x, x), muladd(d, x, x)
        e, f, g, h = muladd(e, x, x), muladd(f, x, x), muladd(g, x, x), muladd(h, x, x)
    store(array, 0, a + b + c + d + e + f + g + h)


@kernel
def _roots(array, times):
    """Four independent chains of 1 / sqrt."""
    w = array.size // 9
    a, b, c, d = load(array, w), load(array, 2 * w), load(array, 3 * w), load(array, 4 * w)
    for _ in range(times):
        a, b, c, d = 1.0 / sqrt(a), 1.0 / sqrt(b), 1.0 / sqrt(c), 1.0 / sqrt(d)
    store(array, 0, a + b + c + d)


@kernel
def _copy(target, source):
    for i in range(target.size):
        target[i] = source[i]


def arithmetic_rate(precision: DTypeLike) -> float:
    """Multiplications and additions a second."""
    array, times = _chains(precision), 100_000
    return 16 * lanes(precision) * times / seconds(lambda: _arithmetic(array, times))


def root_rate(precision: DTypeLike) -> float:
    """Evaluations of 1 / sqrt a second."""
    array, times = _chains(precision), 30_000
    return 4 * lanes(precision) * times / seconds(lambda: _roots(array, times))


def copy_rate(size: int) -> float:
    """Bytes a second that a copy of so many bytes reads and writes."""
    source = np.ones(size // 16)
    target = np.zeros_like(source)
    return 2 * source.nbytes / seconds(lambda: _copy(target, source))


def _chains(precision: DTypeLike) -> NDArray[Any]:
    return np.full(9 * lanes(precision), 0.5, dtype=precision)
