import itertools

import numpy as np
import pytest
import torch

from raptor.raster import rasterise
from raptor.symmetry import FIELDS, Element, apply, move_pixels

pytestmark = pytest.mark.one_processor

ELEMENTS = Element.all()


def test_the_eight_elements_are_a_group():
    assert len(set(ELEMENTS)) == 8
    for a, b in itertools.product(ELEMENTS, ELEMENTS):
        assert a @ b in ELEMENTS
        assert np.array_equal((a @ b).matrix, a.matrix @ b.matrix)
        assert np.allclose((a @ b).channel_matrix, a.channel_matrix @ b.channel_matrix)
    for element in ELEMENTS:
        assert element.inverse @ element == ELEMENTS[0]
        assert Element.from_index(element.index) == element


def test_apply_is_a_group_action_with_inverses():
    fields = np.random.default_rng(0).normal(size=(2, 8, 6, 6))
    for a, b in itertools.product(ELEMENTS, ELEMENTS):
        assert np.array_equal(apply(apply(fields, a), b), apply(fields, b @ a))
    for element in ELEMENTS:
        assert np.array_equal(apply(apply(fields, element), element.inverse), fields)


@pytest.mark.parametrize("element", ELEMENTS, ids=str)
def test_transforming_cells_then_rasterising_is_rasterising_then_transforming(element):
    rng = np.random.default_rng(1)
    positions = rng.uniform(-20, 25, (30, 2))
    orientation = rng.normal(size=(30, 3))
    orientation /= np.linalg.norm(orientation, axis=1, keepdims=True)
    tension = rng.normal(size=30)
    turned = orientation.copy()
    turned[:, :2] = orientation[:, :2] @ element.matrix.T
    direct = rasterise(positions @ element.matrix.T, turned, tension, 64)
    moved = apply(rasterise(positions, orientation, tension, 64), element)
    for field, a, b in zip(FIELDS, direct, moved, strict=True):
        assert a == pytest.approx(b, abs=1e-6), field


def test_a_quarter_turn_is_counter_clockwise():
    fields = np.zeros((8, 4, 4))
    fields[:, 0, 3] = [1, 2, 3, 4, 5, 6, 7, 8]  # low y, high x
    turned = apply(fields, Element(1, False))
    # (x, y) -> (-y, x): to high y, high x; components as the model states.
    assert turned[:, 3, 3].tolist() == [1, 2, 4, 3, 5, -6, -8, 7]
    mirrored = apply(fields, Element(0, True))
    assert mirrored[:, 0, 0].tolist() == [1, 2, 3, 4, 5, -6, -7, 8]


def test_pixels_move_without_values():
    image = np.arange(16).reshape(4, 4)
    for element in ELEMENTS:
        moved = move_pixels(image, element)
        assert sorted(moved.ravel()) == list(range(16))
        assert np.array_equal(move_pixels(moved, element.inverse), image)


def test_tensors_of_torch_move_as_arrays_of_numpy_do():
    rng = np.random.default_rng(2)
    for fields in (rng.normal(size=(2, 3, 8, 5, 5)), rng.normal(size=(8, 4, 6)).astype(np.float32)):
        for element in ELEMENTS:
            tensor = apply(torch.from_numpy(fields), element)
            assert np.array_equal(tensor.numpy(), apply(fields, element))
            assert tensor.numpy().dtype == apply(fields, element).dtype == fields.dtype
            moved = move_pixels(torch.from_numpy(fields), element)
            assert np.array_equal(moved.numpy(), move_pixels(fields, element))
