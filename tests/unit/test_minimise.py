"""The memory of the minimiser."""

import numpy as np
import pytest

from raptor.condor.minimise import MEMORY, _direction_kernel, _keep_kernel, _workplace
from tests import naive


def test_directions_are_those_of_the_textbook():
    """Also after steps without curvature were refused, and after the memory was dropped."""
    rng = np.random.default_rng(5)
    state = rng.normal(size=60)
    work, pairs = _workplace(state), []
    curvature = rng.uniform(0.5, 2.0, size=60)
    refused = {3, 2 * MEMORY, 2 * MEMORY + 1, 3 * MEMORY + 3}
    for number in range(5 * MEMORY):
        step = rng.normal(size=60)
        change = curvature * step * (-1 if number in refused else 1)
        work.trial[:], work.trial_gradient[:] = state + step, work.gradient + change
        if number == 4 * MEMORY:
            work.held[0], pairs = 0, []
        _keep_kernel(state, work)
        assert np.array_equal(state, work.trial)
        stored = step.astype(np.float32).astype(float), change.astype(np.float32).astype(float)
        pairs = pairs[-(MEMORY - 1) :]
        pairs += [] if number in refused else [stored]
        slope, move, turn = _direction_kernel(work)
        wanted = naive.lbfgs_direction(pairs, work.gradient)
        assert work.direction == pytest.approx(wanted, rel=1e-6, abs=1e-6 * np.abs(wanted).max())
        assert move == np.abs(work.direction[:30]).max()
        assert turn == np.abs(work.direction[30:]).max()
        assert slope == pytest.approx(wanted @ work.gradient, rel=1e-6)
