import numpy as np
import pytest

from raptor.condor.simd import (
    DOUBLES,
    dot,
    doubles,
    lanes,
    larger,
    largest,
    load,
    load_double,
    magnitude,
    muladd,
    positive,
    sqrt,
    store,
    total,
    where,
)
from raptor.core.compiled import kernel

RNG = np.random.default_rng(3)


@kernel
def _everything(out, a, b, i, bits):
    x, y = load(a, i), load(b, i)
    store(out[0], 0, x + y)
    store(out[1], 0, x - 2.0)
    store(out[2], 0, 3.0 * y)
    store(out[3], 0, x / y)
    store(out[4], 0, sqrt(y))
    store(out[5], 0, positive(x))
    store(out[6], 0, where(bits, 0.7, x))
    store(out[7], 0, muladd(x, y, 0.25 * x))
    store(out[8], 0, dot(x, y, y, y, 2.0 * x, x))
    store(out[9], 0, larger(magnitude(x), y))
    return total(x), largest(x), total(muladd(doubles(2.0), load_double(a, i), load_double(b, i)))


@pytest.mark.parametrize("precision", [np.float64, np.float32])
def test_lanes_compute_as_arrays_do(precision):
    width = lanes(precision)
    a = RNG.normal(size=40).astype(precision)
    b = RNG.uniform(1, 2, size=40).astype(precision)
    bits, i = np.uint16(0b0000_0101_0110_1001), 3
    out = np.zeros((10, width), precision)
    summed, most, double = _everything(out, a, b, i, bits)
    x, y = a[i : i + width], b[i : i + width]
    held = np.array([bits >> lane & 1 for lane in range(width)])
    wanted = [
        x + y, x - 2, 3 * y, x / y, np.sqrt(y), np.maximum(x, 0), 0.7 * held,
        x * y + x / 4, x * y + y * y + 2 * x * x, np.maximum(abs(x), y),
    ]  # fmt: skip
    assert out == pytest.approx(np.array(wanted), rel=1e-5 if precision == np.float32 else 1e-14)
    assert summed == pytest.approx(x.sum(dtype=float), rel=1e-5)
    assert most == x.max()
    wide = slice(i, i + DOUBLES)
    assert double == pytest.approx((2 * a[wide].astype(float) + b[wide]).sum(), rel=1e-14)


def test_nan_does_not_hide_the_largest_lane():
    assert _largest_of(np.array([np.nan, 1, -3, np.nan, 2, 0, 0, np.nan])) == 3


@kernel
def _largest_of(a):
    return largest(larger(doubles(0.0), magnitude(load_double(a, 0))))


def test_a_register_holds_more_single_numbers():
    assert lanes(np.float32) == 2 * lanes(np.float64)
