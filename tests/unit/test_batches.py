"""What networks learn from: examples as scaled images, under D4 and at random places."""

import numpy as np
import pytest
import shapely
import torch

from raptor.core.errors import RaptorError
from raptor.dataset.examples import list_examples, training_scaling
from raptor.dataset.scaling import Scaling
from raptor.dataset.stack import read_table
from raptor.fields.resample import coarse_images
from raptor.frame import pixel_size
from raptor.moulds import Circle, Mould, moulds_by_id
from raptor.moulds.cast import CastMould
from raptor.surrogate.batches import RIM, ExampleSet, images_under, shifted_at_random, split_examples
from raptor.symmetry import Element, apply, move_pixels

SCALING = Scaling((0.0,) * 8, (1.0,) * 8)
LAYERS, PIXELS = 4, 64


def moulds_of(made):
    return moulds_by_id(made / "moulds.geojson")


def test_examples_kept_in_memory_are_those_read_from_files(made):
    stack = made / "fields.nc"
    device = torch.device("cpu")
    given = list_examples(stack), moulds_of(made), training_scaling(stack)
    kept, read = (ExampleSet([stack], *given) for _ in range(2))
    kept.keep(device)
    order = torch.randperm(len(read)).tolist()
    batches = list(zip(kept.batches(order, 5, device), read.batches(order, 5, device), strict=True))
    assert sum(len(inputs) for (inputs, _), _ in batches) == len(read)
    for ours, theirs in batches:
        assert all(torch.equal(a, b) for a, b in zip(ours, theirs, strict=True))


def test_a_split_without_examples_is_named(made):
    stack = made / "fields.nc"
    with pytest.raises(RaptorError, match=r"no validation example; raise the campaign's runs"):
        split_examples(
            [stack], list_examples(stack, ["train"]), read_table(stack).split, moulds_of(made), SCALING, 32
        )


def test_a_mould_that_is_not_given_is_named(made):
    stack, known = made / "fields.nc", moulds_of(made)
    known.pop(read_table(stack).mould[0])
    with pytest.raises(RaptorError, match=r"^mould .* is not among the \d+ given; give those of the file"):
        ExampleSet(stack, list_examples(stack), known, SCALING)


def test_images_under_d4_are_those_of_the_symmetry():
    rng = torch.Generator().manual_seed(0)
    inputs, targets = torch.rand(8, 6, 16, 16, generator=rng), torch.rand(8, 8, 16, 16, generator=rng)
    moved, applied = images_under(torch.arange(8), inputs, targets)
    for number, element in enumerate(Element.all()):
        assert torch.equal(moved[number], move_pixels(inputs[number], element))
        assert torch.equal(applied[number], apply(targets[number], element))


def test_examples_lie_anywhere_in_the_frame_but_at_its_rim():
    rng = torch.Generator().manual_seed(0)
    inputs, targets = torch.full((60, 6, 32, 32), -1.0), torch.zeros(60, 8, 32, 32)
    inputs[:, :, 8:14, 10:27] = torch.rand(60, 6, 6, 17, generator=rng)
    targets[:, :, 6:16, 8:29] = torch.rand(60, 8, 10, 21, generator=rng)
    torch.manual_seed(0)
    moved, applied = shifted_at_random(inputs, targets)
    corners = []
    for number in range(60):
        rows, columns = torch.nonzero(moved[number, 0] > -1, as_tuple=True)
        corners.append((int(rows.min()), int(columns.min())))
        step = corners[-1][0] - 8, corners[-1][1] - 10
        assert torch.equal(moved[number], torch.roll(inputs[number], step, (1, 2)))
        assert torch.equal(applied[number], torch.roll(targets[number], step, (1, 2)))
    rows, columns = zip(*corners, strict=True)
    assert (min(rows), max(rows)) == (RIM, 32 - RIM - 6)
    assert (min(columns), max(columns)) == (RIM, 32 - RIM - 17)


def test_a_mould_that_fills_the_frame_stays():
    inputs, targets = torch.ones(2, 6, 16, 16), torch.rand(2, 8, 16, 16)
    assert all(
        torch.equal(a, b) for a, b in zip(shifted_at_random(inputs, targets), (inputs, targets), strict=True)
    )


def test_networks_see_how_the_lattice_meets_the_walls():
    """A mould moved by a quarter of a lattice step has the same masks, moved, but casts other cells."""
    box = Mould(shapely.box(-10, -5.1, 10, 5.1), [Circle(-4, 0, 1.2)])
    step = pixel_size(256)
    shifted = Mould(shapely.box(-10 + step, -5.1, 10 + step, 5.1), [Circle(-4 + step, 0, 1.2)])
    here, there = (CastMould(mould, LAYERS, 256) for mould in (box, shifted))
    assert np.array_equal(np.roll(here.depression, 1, axis=1), there.depression)
    assert np.abs(np.roll(here.relative_density, 1, axis=1) - there.relative_density).max() > 0.1
    seen = coarse_images(here, PIXELS)
    assert seen[2].sum() * LAYERS * pixel_size(PIXELS) ** 2 == pytest.approx(here.n_cells, rel=1e-5)
    assert seen[2, 32, 35:37] == pytest.approx(1, abs=1e-3)
    turned = CastMould(box.transformed(Element.from_index(5).matrix), LAYERS, 256)
    assert np.allclose(coarse_images(turned, PIXELS), move_pixels(seen, Element.from_index(5)), atol=1e-6)
