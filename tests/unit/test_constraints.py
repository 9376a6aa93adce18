"""Whatever a network says, its predictions obey what every tissue obeys."""

import numpy as np
import pytest
import shapely
import torch

from raptor.dataset.scaling import Scaling
from raptor.fields.metrics import without_sign
from raptor.fields.resample import block_average, deconvolve
from raptor.frame import pixel_centres, pixel_size
from raptor.moulds import Circle, Mould, mould_image
from raptor.parameters import CellParameters
from raptor.raster import rasterise
from raptor.surrogate import constraints
from raptor.surrogate.generator import Generator
from raptor.surrogate.inference import Surrogate
from raptor.surrogate.rules import Architecture
from raptor.symmetry import Element, apply

PIXELS, CELLS = 64, 300
SCALING = Scaling((0.2, 0.0, 0.1, 0.1, 0.1, 0.0, 0.0, 0.0), (0.2, 1.5, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1))
MOULD = Mould(shapely.box(-9, -5, 7, 5), (Circle(4.0, 1.0, 1.2),), name="lopsided")
PARAMETERS = CellParameters(0.6, 0.4, 0.2)


def depression():
    return torch.from_numpy(mould_image(MOULD, PIXELS).depression.astype(np.float32))[None, None]


def require_physical(fields, cells=CELLS, small=1e-5):
    """Fields (n, 8, y, x) in physical units of `MOULD`."""
    fields = fields.double()
    density, xx, yy, zz = fields[:, 0], fields[:, 2], fields[:, 3], fields[:, 4]
    top = float(density.max())
    assert density.min() >= 0
    assert density.sum((1, 2)).numpy() == pytest.approx(cells, rel=1e-5)
    assert (xx + yy + zz - density).abs().max() < small * top
    rows = torch.stack([xx, fields[:, 5], fields[:, 6], fields[:, 5], yy, fields[:, 7]], -1)
    tensor = torch.cat([rows, torch.stack([fields[:, 6], fields[:, 7], zz], -1)], -1)
    lowest = torch.linalg.eigvalsh(tensor.reshape(*xx.shape, 3, 3))[..., 0]
    assert lowest.min() > -small * top
    outside = constraints.reachable(depression())[0, 0] == 0
    assert outside.any()
    assert (density[:, outside] == 0).all()


def random_fields(count=3, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(count, 8, PIXELS, PIXELS, generator=generator)


def test_reach_is_five_sigma_and_covers_thin_posts():
    there = constraints.reachable(depression())[0, 0]
    x = torch.from_numpy(pixel_centres(PIXELS))
    row = there[PIXELS // 2]
    assert float(x[row > 0].min()) == pytest.approx(-9 - constraints.DEEP, abs=pixel_size(PIXELS))
    assert (there >= depression()[0, 0]).all()


def test_outputs_obey_the_physics_by_construction():
    head = constraints.PhysicalFields(SCALING)
    cells, delta = torch.full((3,), float(CELLS)), torch.tensor([0.1, 0.5, 0.9])
    for size in (1.0, 30.0):
        scaled = head(size * random_fields(), depression().expand(3, -1, -1, -1), cells, delta)
        require_physical(torch.from_numpy(SCALING.inverse(scaled.numpy())), small=1e-4)


def test_there_is_no_tension_where_there_is_no_tissue():
    there, cells = constraints.reachable(depression()), torch.tensor([float(CELLS)])
    fields = random_fields()
    fields[:, 0, :, : PIXELS // 2] = -1.0
    free = fields.clone()
    free[:, 0] *= 40.0  # softplus leaves nothing
    delta = torch.full((len(free),), 0.5)
    head = constraints.PhysicalFields(SCALING)(free, depression().expand(len(free), -1, -1, -1), cells, delta)
    for made in (constraints.project(fields, there, cells), torch.from_numpy(SCALING.inverse(head.numpy()))):
        assert (made[:, 1, :, : PIXELS // 2].abs() < 1e-9).all()
        assert (made[:, 1, :, PIXELS // 2 :] != 0).any()


def test_any_fields_obey_it_after_projection_and_physical_ones_stay():
    there, cells = constraints.reachable(depression()), torch.tensor([float(CELLS)])
    once = constraints.project(random_fields(), there, cells)
    require_physical(once)
    twice = constraints.project(once, there, cells)
    assert (twice - once).abs().max() < 1e-4 * once.abs().max()


def test_an_average_obeys_it_and_keeps_what_does_not_change():
    there, cells = constraints.reachable(depression()).expand(3, -1, -1, -1), torch.full((3,), float(CELLS))
    fields = constraints.project(random_fields(), there, cells)
    require_physical(constraints.with_sign(without_sign(fields).mean(0, keepdim=True)))
    alike, top = constraints.with_sign(without_sign(fields[:1])), fields[0].abs().max()
    assert (without_sign(alike) - without_sign(fields[:1])).abs().max() < 1e-3 * top
    flipped = fields[:1] * torch.tensor([1.0, 1, 1, 1, 1, 1, -1, -1])[:, None, None]
    both = without_sign(torch.cat([fields[:1], flipped])).mean(0, keepdim=True)
    assert (constraints.with_sign(both) - alike).abs().max() < 1e-5 * top


@pytest.mark.parametrize("seen", [PIXELS, PIXELS // 2])
@pytest.mark.parametrize("network", ["pix2pix", "film_unet", "fno"])
def test_the_prediction_of_a_turned_mould_is_the_turned_prediction(network, seen):
    torch.manual_seed(0)
    architecture = Architecture(network=network, pixels=seen, base_channels=8)
    generator, twin = Generator(architecture, SCALING), Generator(architecture, SCALING)
    surrogate = Surrogate((generator.eval(), twin.eval()), architecture, SCALING, 2, PIXELS)
    (plain,) = surrogate.predict(MOULD, [PARAMETERS])
    require_physical(torch.from_numpy(plain)[None], surrogate.cast(MOULD).n_cells, small=1e-4)
    for element in (Element(1, mirror=False), Element(2, mirror=True)):
        (found,) = surrogate.predict(MOULD.transformed(element.matrix), [PARAMETERS])
        wanted = without_sign(apply(plain, element))
        assert np.abs(without_sign(found) - wanted).max() < 1e-5 * np.abs(wanted).max()


def test_a_coarse_image_of_a_tissue_holds_the_fine_one():
    rng = np.random.default_rng(0)
    positions = rng.uniform((-12, -8, 0), (10, 9, 3), (400, 3))
    orientation = rng.normal(size=(400, 3))
    orientation /= np.linalg.norm(orientation, axis=1)[:, None]
    cells = (positions, orientation, rng.normal(size=400))
    fine, coarse = (rasterise(*cells, pixels) for pixels in (256, 128))
    assert (
        np.abs(4 * block_average(fine, 128) - coarse).max() < 1e-7 * np.abs(coarse).max()
    )  # sums over squares
    for pixels, least in ((128, 1e-5), (64, 0.05)):
        again = deconvolve(block_average(fine, pixels), 256)
        assert np.abs(again - fine).max() < least * np.abs(fine).max()
        tensor = deconvolve(torch.from_numpy(block_average(fine, pixels)), 256)
        assert np.abs(tensor.numpy() - again).max() < 1e-12 * np.abs(fine).max()
    assert deconvolve(fine, 256) is fine
