import numpy as np
import pytest

from raptor.core.errors import RaptorError
from raptor.fields.metrics import normalised
from raptor.frame import IMAGE_SIZE
from raptor.raster import SIGMA, rasterise
from tests import naive


@pytest.fixture
def cells():
    rng = np.random.default_rng(2)
    orientation = rng.normal(size=(12, 3))
    orientation /= np.linalg.norm(orientation, axis=1, keepdims=True)
    return rng.uniform(-15, 15, (12, 2)), orientation, rng.normal(size=12)


def test_fields_are_those_of_the_slow_twin(cells):
    slow = naive.rasterise(*cells, 32, SIGMA, IMAGE_SIZE)
    assert rasterise(*cells, 32) == pytest.approx(slow, abs=1e-8)


@pytest.mark.parametrize("pixels", [32, 128, 256])
def test_invariants_at_every_raster(cells, pixels):
    fields = rasterise(*cells, pixels)
    assert fields[0].sum() == pytest.approx(12, rel=1e-6)
    assert fields[2] + fields[3] + fields[4] == pytest.approx(fields[0], abs=1e-12)
    assert fields[1].sum() == pytest.approx(cells[2].sum(), rel=1e-6)
    assert (fields[0] >= 0).all()
    assert normalised(fields, 12)[1].mean() == pytest.approx(cells[2].mean(), rel=1e-6)


def test_sigma_is_a_length_whatever_the_raster(cells):
    fine = rasterise(*cells, 256).reshape(8, 64, 4, 64, 4).sum(axis=(2, 4))
    assert rasterise(*cells, 64) == pytest.approx(fine, abs=1e-8)


def test_cells_outside_the_image_do_no_harm(cells):
    far = cells[0] + 500
    assert rasterise(far, *cells[1:], 32).sum() == 0


def test_arrays_of_different_length_are_named(cells):
    with pytest.raises(RaptorError, match="one of each"):
        rasterise(cells[0], cells[1], cells[2][:-1], 32)
