"""What a trial move is made of."""

import numpy as np
import pytest

from raptor.condor.anneal import DRAWS, _circle_kernel, _propose_kernel, _uniform_kernel
from raptor.condor.simd import lanes, load, store
from raptor.core.compiled import kernel

WIDTH = lanes(np.float64)


@kernel
def _propose(out, old, random, step, turn):
    state = (load(old, 0), load(old, 8), load(old, 16), load(old, 24), load(old, 32), load(old, 40))
    for row, value in enumerate(_propose_kernel(state, random, step, turn)):
        store(out[row], 0, value)


@kernel
def _circle(out, parts):
    cosine, sine = _circle_kernel(load(parts, 0))
    store(out[0], 0, cosine)
    store(out[1], 0, sine)


def test_random_numbers_are_uniform_and_hang_on_their_place_alone():
    numbers = np.zeros(200_000)
    _uniform_kernel(numbers, np.uint64(99), np.uint64(0))
    assert numbers.min() >= 0
    assert numbers.max() < 1
    counts = np.histogram(numbers, 50, (0, 1))[0]
    expected = len(numbers) / 50
    assert ((counts - expected) ** 2 / expected).sum() < 49 + 5 * np.sqrt(2 * 49)  # chi squared
    assert abs(np.corrcoef(numbers[:-1], numbers[1:])[0, 1]) < 5 / np.sqrt(len(numbers))
    later = np.zeros(16)
    _uniform_kernel(later, np.uint64(99), np.uint64(1000))
    assert np.array_equal(later, numbers[1000:1016])
    _uniform_kernel(later, np.uint64(98), np.uint64(1000))
    assert not np.array_equal(later, numbers[1000:1016])


def test_the_circle_is_round():
    out = np.zeros((2, WIDTH))
    for parts in np.linspace(-0.5, 0.5, 500 * WIDTH).reshape(-1, WIDTH):
        _circle(out, parts)
        wanted = np.array([np.cos(2 * np.pi * parts), np.sin(2 * np.pi * parts)])
        assert out == pytest.approx(wanted, abs=1e-4)
        assert (out**2).sum(axis=0) == pytest.approx(1)


def test_proposals_move_evenly_and_turn_alike_in_all_directions():
    """Detailed balance: a turn hangs on the angle between old and new alone."""
    old = np.zeros((6, WIDTH))
    axis = np.array([0.6, 0.0, 0.8])
    old[3:] = axis[:, None]
    random, out, moves, turned = np.zeros(DRAWS * WIDTH), np.zeros((6, WIDTH)), [], []
    for count in range(4000):
        _uniform_kernel(random, np.uint64(7), np.uint64(count * len(random)))
        _propose(out, old.ravel(), random, 0.2, 1.0)
        moves.append(out[:3].copy())
        turned.append(out[3:].copy())
    moves, turned = np.concatenate(moves, axis=1), np.concatenate(turned, axis=1)
    assert np.abs(moves).max() <= 0.2
    assert moves.mean(axis=1) == pytest.approx(0, abs=5 * 0.2 / np.sqrt(3 * moves.shape[1]))
    assert np.linalg.norm(turned, axis=0) == pytest.approx(1)
    across = turned - axis[:, None] * (axis @ turned)
    one, other = np.array([0.0, 1.0, 0.0]), np.array([0.8, 0.0, -0.6])  # perpendicular to the axis
    azimuth = np.arctan2(one @ across, other @ across)
    for order in (1, 2, 3, 4):
        assert abs(np.exp(1j * order * azimuth).mean()) < 5 / np.sqrt(len(azimuth))
