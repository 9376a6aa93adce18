"""Whether tissue is held by its tethers, and how cells line up."""

import numpy as np
import pytest
import shapely

from raptor.condor.simulate import simulate
from raptor.fields.directors import alignment, anisotropy, cell_alignment
from raptor.fields.tethers import contact, held, posts_lost, seen_held
from raptor.moulds import Circle, Mould, PolygonTether
from raptor.moulds.cast import CastMould
from raptor.moulds.loops import centre_of, smallest_loop, winding
from raptor.parameters import CellParameters
from raptor.raster import density_image, rasterise
from tests import naive

POST, BAR = Circle(-6.0, 0.5, 1.3), PolygonTether(shapely.box(4.0, -5.0, 5.5, 5.0))
MOULD = Mould(shapely.box(-12.3, -8.2, 12.3, 8.2), (POST, BAR))


@pytest.fixture
def cast():
    return CastMould(MOULD, 3, 128)


def without(positions, cells, shift):
    """Positions, with some cells moved in the plane."""
    moved = positions.copy()
    moved[cells, :2] += shift
    return moved


def test_as_cast_every_tether_is_held_and_touched(cast):
    assert held(cast.sites, cast).tolist() == [1, 1]
    assert contact(cast.sites, cast).tolist() == [1, 1]
    assert seen_held(cast.density, cast).tolist() == [1, 1]
    assert posts_lost(held(cast.sites, cast)) == 0


def test_a_post_drawn_away_from_its_tissue_is_lost(cast):
    """The tissue as a whole moves away, or slips off layer by layer."""
    gone = without(cast.sites, slice(None), (0, 20))
    assert held(gone, cast).tolist() == [0, 0]
    assert contact(gone, cast).tolist() == [0, 0]
    layer = np.rint(cast.sites[:, 2] * np.sqrt(2) - 0.5)
    one_off = without(cast.sites, layer == 1, (0, 20))
    assert held(one_off, cast) == pytest.approx(2 / 3)
    assert posts_lost(held(one_off, cast)) == 0
    two_off = without(cast.sites, layer >= 1, (0, 20))
    assert held(two_off, cast) == pytest.approx(1 / 3)
    assert posts_lost(held(two_off, cast)) == 2


def test_a_post_is_lost_where_the_tissue_contracts_past_it(cast):
    """All cells to the left of the post end up on its right."""
    slipped = cast.sites.copy()
    slipped[:, 0] = np.maximum(slipped[:, 0], POST.x + 2.0)
    assert held(slipped, cast).tolist() == [0, 1]
    density = density_image(slipped, 128)
    assert seen_held(density, cast).tolist() == [0, 1]


def test_a_bar_whose_middle_is_let_go_is_held_with_less_contact(cast):
    """Tissue leaves the middle of the bar's right side and stays around both ends."""
    beside = (cast.sites[:, 0] > 5.5) & (np.abs(cast.sites[:, 1]) < 3.5)
    bowed = without(cast.sites, beside, (3.0, 0.0))
    assert held(bowed, cast).tolist() == [1, 1]
    assert contact(bowed, cast)[0] == 1
    assert 0.6 < contact(bowed, cast)[1] < 0.9


def test_a_tether_at_the_outline_has_no_loop_but_contact():
    mould = Mould(shapely.box(-8, -6, 8, 6), (PolygonTether(shapely.box(-1, -6, 1, 2)), Circle(5, 0, 1)))
    cast = CastMould(mould, 2, 128)
    shares = held(cast.sites, cast)
    assert np.isnan(shares[0]) and shares[1] == 1
    assert np.isnan(seen_held(cast.density, cast)[0])
    assert 0.5 < contact(cast.sites, cast)[0] < 1
    assert posts_lost(shares) == 0


@pytest.mark.parametrize(("gap", "encircled"), [(0.2, False), (0.5, False), (2.0, True), (3.0, True)])
def test_an_image_shows_the_tethers_that_have_room_for_a_row_of_cells(gap, encircled):
    """A gap narrower than a row of sites may look closed at a low density; nothing encircles that tether."""
    cast = CastMould(Mould(shapely.box(-8, -6, 8, 6), (Circle(0, 6 - 1.5 - gap, 1.5),)), 4, 256)
    for shares in (held(cast.sites, cast), seen_held(cast.density, cast)):
        assert np.isfinite(shares[0]) == encircled


def test_a_post_between_pixel_centres_can_be_lost():
    """At 32 pixels of 2 l0 no centre lies in it; the nearest one decides."""
    cast = CastMould(Mould(shapely.box(-20, -12, 20, 12), (Circle(0.0, 0.0, 0.5),)), 3, 32)
    assert (cast.tether_depths[0] < 0).all()
    assert seen_held(cast.density, cast).tolist() == [1.0]
    assert seen_held(np.zeros_like(cast.density), cast).tolist() == [0.0]


def test_what_a_simulated_tissue_holds():
    made = simulate(MOULD, CellParameters(0.4, 0.5, 0.3), 2, "draft")
    assert made.held.tolist() == [1, 1]
    assert made.posts_lost == 0
    assert ((made.contact > 0.4) & (made.contact <= 1)).all()
    assert seen_held(made.rasterised()[0], made.cast_mould).tolist() == [1, 1]
    assert made.alignment == pytest.approx(alignment(made.rasterised(), made.cast_mould), abs=1e-6)


CORNER = PolygonTether(shapely.Polygon([(-5, -4), (3, -4), (3, -2.8), (-3.8, -2.8), (-3.8, 4), (-5, 4)]))


@pytest.mark.parametrize("tether", [POST, BAR, CORNER, Circle(-9.6, 4.9, 1.1)])
def test_loops_are_closed_and_as_short_as_those_of_the_slow_twin(tether):
    cast = CastMould(Mould(shapely.box(-12.3, -8.2, 12.3, 8.2), (tether,)), 2, 64)
    centre = centre_of(tether)
    for layer in range(2):
        plane = np.unique(cast.sites[np.isclose(cast.sites[:, 2], (layer + 0.5) / np.sqrt(2)), :2], axis=0)
        loop = smallest_loop(plane, centre)
        steps = np.abs(plane[loop] - np.roll(plane[loop], 1, axis=0)).sum(axis=1)
        assert steps == pytest.approx(1)
        assert len(set(loop.tolist())) == len(loop) == naive.smallest_loop_length(plane, centre)
        assert abs(winding(plane[loop], centre)) == 1


def test_held_and_contact_are_those_of_the_slow_twins(cast):
    rng = np.random.default_rng(3)
    for size in (0.3, 3.0, 6.0):
        moved = cast.sites + rng.normal(0, size, cast.sites.shape)
        shares, touching = held(moved, cast), contact(moved, cast)
        for number, tether in enumerate(MOULD.tethers):
            wanted = naive.held(moved, cast.sites, cast.loops[number], centre_of(tether))
            assert shares[number] == pytest.approx(wanted)
            assert touching[number] == pytest.approx(naive.contact(moved, tether.polygon, 1.5), abs=0.02)


def test_alignment_and_anisotropy_are_those_of_the_slow_twins(cast):
    rng = np.random.default_rng(4)
    orientation = rng.normal(size=cast.sites.shape) * (2, 1, 1)
    orientation /= np.linalg.norm(orientation, axis=1)[:, None]
    tilted = CastMould(Mould(shapely.affinity.rotate(shapely.box(-12, -5, 12, 5), 30)), 1, 64)
    direction = np.cos(np.pi / 6), np.sin(np.pi / 6)
    assert cell_alignment(orientation, tilted) == pytest.approx(naive.alignment(orientation, direction))
    fields = rasterise(cast.sites, orientation, np.zeros(len(orientation)), 32)
    assert alignment(fields, tilted) == pytest.approx(naive.alignment(orientation, direction), abs=1e-6)
    assert anisotropy(fields) == pytest.approx(naive.anisotropy(fields))


def test_alignment_and_anisotropy_at_their_ends(cast):
    along = np.tile([1.0, 0.0, 0.0], (cast.n_cells, 1))
    across = np.tile([0.0, 1.0, 0.0], (cast.n_cells, 1))
    upright = np.tile([0.0, 0.0, 1.0], (cast.n_cells, 1))
    assert cell_alignment(along, cast) == 1
    assert cell_alignment(across, cast) == -1
    assert np.isnan(cell_alignment(upright, cast))
    mixed = np.where(np.arange(cast.n_cells)[:, None] % 2 == 0, along, across)
    assert abs(cell_alignment(mixed, cast)) < 0.01
    still = np.zeros(cast.n_cells)
    assert anisotropy(rasterise(cast.sites, across, still, 64)) == pytest.approx(1)
    assert anisotropy(rasterise(cast.sites, mixed, still, 64)) < 0.2
