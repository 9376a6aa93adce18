"""A/A0 and w/w0: over the tissue as cast, and over the mould as the paper words them."""

import numpy as np
import pytest
import shapely

from raptor.core.errors import RaptorError
from raptor.fields.shape import area_above, filled, mould_ratios, outline_ratios, shape_ratios
from raptor.frame import pixel_centres, pixel_size
from raptor.moulds import Circle, Mould, PolygonTether, read_mould
from raptor.moulds.cast import CastMould, central_section
from raptor.moulds.library import MOULDS
from raptor.moulds.random_moulds import RandomMoulds
from raptor.raster import density_image, density_threshold
from raptor.symmetry import Element

pytestmark = pytest.mark.one_processor

X, Y = np.meshgrid(pixel_centres(256), pixel_centres(256))
BOX = shapely.box(-20, -10, 20, 10)
POSTS = tuple(Circle(x, y, 1.3) for x in (-15, 15) for y in (-6, 6))
DRAWN = RandomMoulds(cells=(1500, 5000), tethers=(0, 8))


def smooth_box(half_x, half_y):
    """A density that crosses 1/2 exactly at the edges of a box."""

    def edge(u, half):
        return 1 / (1 + np.exp(np.clip((np.abs(u) - half) / 0.3, -50, 50)))

    return np.minimum(edge(X, half_x), edge(Y, half_y))


def seen(outline, tethers=(), layers=4):
    return CastMould(Mould(outline, tethers), layers, 256)


def shrunk(cast, x, y):
    """Density of the tissue as cast, its cells moved towards the origin by factors."""
    return density_image(cast.sites * (x, y, 1.0), 256) * x * y


def test_over_the_mould_width_is_found_between_pixels():
    for half in (4.0, 4.03, 4.11, 7.77):
        assert mould_ratios(smooth_box(15, half), seen(BOX), 0.5)[1] == pytest.approx(half / 10, abs=2e-3)


def test_width_is_measured_across_the_long_side_whichever_it_is():
    tall = seen(shapely.box(-10, -20, 10, 20))
    assert mould_ratios(smooth_box(6, 15), tall, 0.5)[1] == pytest.approx(0.6, abs=2e-3)
    square = seen(shapely.box(-10, -10, 10, 10))  # x counts as the long side
    assert mould_ratios(smooth_box(9, 5), square, 0.5)[1] == pytest.approx(0.5, abs=2e-3)
    tilted = Mould(shapely.affinity.rotate(BOX, 30))
    (x0, y0), (x1, y1) = central_section(tilted).coords
    assert np.degrees(np.arctan2(y1 - y0, x1 - x0)) % 180 == pytest.approx(120, abs=1e-6)


def test_over_the_mould_tethers_on_the_section_count_as_no_depression():
    cast = seen(BOX, (Circle(0, 0, 2),))
    assert mould_ratios(smooth_box(15, 4), cast, 0.5)[1] == pytest.approx(8 / 16, abs=2e-3)


def test_a_section_without_depression_or_tissue_has_no_width():
    posts = tuple(Circle(0, y, 1.3) for y in (-3.7, -1.3, 1.3, 3.7))
    cast = seen(shapely.box(-10, -5, 10, 5), posts)
    assert np.isnan(mould_ratios(smooth_box(1, 1), cast, 0.5)[1])
    torn = np.where(np.abs(X) < 2, 0.0, seen(BOX).density)
    area, width = shape_ratios(torn, seen(BOX))
    assert 0.8 < area < 1
    assert np.isnan(width)


@pytest.mark.parametrize("name", MOULDS)
@pytest.mark.parametrize("layers", [1, 4, 7])
def test_before_contraction_both_ratios_are_one_in_the_library(name, layers):
    assert shape_ratios(*_as_cast(CastMould(read_mould(name), layers, 256))).tolist() == [1, 1]


@pytest.mark.parametrize("pixels", [64, 256])
def test_before_contraction_both_ratios_are_one_in_random_moulds(pixels):
    rng = np.random.default_rng(1)
    for _ in range(8):
        ratios = shape_ratios(*_as_cast(CastMould(DRAWN.draw(rng, 4, "m"), 4, pixels)))
        assert ratios[0] == 1
        assert ratios[1] == 1 or np.isnan(ratios[1])


@pytest.mark.parametrize(
    "mould",
    [
        Mould(shapely.box(-31.25, -31.25, 31.25, 31.25), name="fills the frame"),
        Mould(shapely.Point(0, 0).buffer(20), (PolygonTether(shapely.Point(0, 0).buffer(9)),), name="ring"),
        Mould(shapely.box(-10, -0.4, 10, 0.4), name="a row"),
    ],
    ids=lambda mould: mould.name,
)
def test_before_contraction_both_ratios_are_one_at_the_extremes(mould):
    assert shape_ratios(*_as_cast(CastMould(mould, 1, 256))).tolist() == [1, 1]


def test_a_single_cell_is_too_sparse_to_be_seen():
    cast = seen(shapely.box(-0.6, -0.6, 0.6, 0.6), layers=1)
    assert cast.n_cells == 1
    assert np.isnan(shape_ratios(cast.density, cast)).all()


def _as_cast(cast):
    return cast.density, cast


def test_images_of_a_mould_have_equal_ratios():
    mould = Mould(BOX, (*POSTS, Circle(1, 3, 1.3), Circle(-6, -2, 2.5)))
    ratios = []
    for element in Element.all():
        cast = CastMould(mould.transformed(element.matrix), 3, 256)
        sites = CastMould(mould, 3, 256).sites
        moved = sites * (0.8, 0.7, 1.0)
        moved[:, :2] = moved[:, :2] @ element.matrix.T
        ratios.append(shape_ratios(density_image(moved, 256), cast))
    assert np.array(ratios) == pytest.approx(np.tile(ratios[0], (8, 1)), abs=1e-4)
    assert (ratios[0] < 1).all()


def test_the_ratios_do_not_hang_on_where_walls_fall_between_rows():
    """A free gel that shrinks by known factors, in boxes of 17 sizes."""
    casts = [seen(shapely.box(-20 * f, -10 * f, 20 * f, 10 * f)) for f in np.linspace(0.96, 1.04, 17)]
    densities = [shrunk(cast, 0.9, 0.75) for cast in casts]
    found = [shape_ratios(*pair) for pair in zip(densities, casts, strict=True)]
    assert np.mean(found, axis=0) == pytest.approx([0.9 * 0.75, 0.75], abs=0.002)
    assert (np.std(found, axis=0) < 1e-3).all()
    over_the_mould = [mould_ratios(*pair) for pair in zip(densities, casts, strict=True)]
    assert (np.std(over_the_mould, axis=0) > 0.01).all()


def test_areas_are_those_of_what_is_linear_between_pixels():
    centres = np.arange(40) - 19.5
    x, y = np.meshgrid(centres, centres)
    for radius in (3.0, 3.37, 11.9):
        assert area_above(radius - np.hypot(x, y)) == pytest.approx(np.pi * radius**2, rel=0.07 / radius)
    for half in (3.0, 3.21, 3.5):
        assert area_above(half - np.abs(x + 0 * y)) == pytest.approx(2 * half * 40, rel=0.02)
    assert area_above(-np.ones((4, 4))) == 0
    slanted = np.minimum(8.1 - np.abs(0.6 * x + 0.8 * y), 9.2 - np.abs(0.8 * x - 0.6 * y))
    assert area_above(slanted) == pytest.approx(16.2 * 18.4, rel=3e-3)


def test_a_thin_post_on_the_section_changes_the_width_little():
    plain = seen(BOX)
    post = seen(BOX, (Circle(0, 3, 1.3),))
    hollow = plain.sites[np.hypot(plain.sites[:, 0], 0.75 * plain.sites[:, 1] - 3) > 1.3] * (1, 0.75, 1)
    solid, hollow = density_image(plain.sites * (1, 0.75, 1), 256), density_image(hollow, 256)
    assert shape_ratios(hollow, post)[1] == pytest.approx(shape_ratios(solid, plain)[1], abs=0.008)


def test_what_counts_as_tissue_is_thin_and_enclosed():
    def area(radius, tissue):
        """Of a tissue around a post of a radius, l0^2; its hole is a quarter l0 wider."""
        cast = seen(shapely.Point(0, 0).buffer(15), (Circle(4, 0, radius),))
        density = np.where(tissue & (np.hypot(X - 4, Y) > radius + 0.25), 2.0 * cast.threshold, 0.0)
        return area_above(filled(density, cast)) * pixel_size(256) ** 2

    whole, left = np.hypot(X, Y) < 12, (np.hypot(X, Y) < 12) & (X < 4)
    assert area(1.9, whole) == pytest.approx(np.pi * 12**2, rel=0.01)
    assert area(2.1, whole) == pytest.approx(np.pi * (12**2 - 2.35**2), rel=0.01)
    assert area(0.5, left) - area(1.9, left) == pytest.approx(np.pi * (2.15**2 - 0.75**2) / 2, rel=0.1)


def test_tethers_that_overlap_are_as_wide_as_they_are_together():
    row = tuple(Circle(x, 0, 1.8) for x in (-2, 0, 2))
    block = tuple(Circle(x, y, 1.9) for x in (-1.2, 1.2) for y in (-1.2, 1.2))
    assert len(seen(BOX, row).thin_tethers) == 1
    assert len(seen(BOX, block).thin_tethers) == 0
    assert len(seen(BOX, POSTS).thin_tethers) == 4
    assert seen(BOX).thin_tethers.shape == (0, 256, 256)


def test_an_outline_counts_thin_posts_as_a_density_does():
    mould = Mould(BOX, (*POSTS, Circle(0, 3, 1.3)))
    tissue = shapely.box(-17, -7.5, 17, 7.5).intersection(mould.depression)
    area, width = outline_ratios(tissue, mould)
    assert area == pytest.approx(34 * 15 / 800, abs=1e-6)
    assert width == pytest.approx(0.75)
    aside = shapely.box(-20, -10, 20, 3).intersection(mould.depression)  # up to the middle of a post
    area, width = outline_ratios(aside, mould)
    assert area == pytest.approx((40 * 13 - np.pi * 1.3**2 / 2) / 800, abs=1e-3)
    assert width == pytest.approx(11.7 / 20)


def test_the_threshold_is_the_papers_at_its_scale():
    assert density_threshold(7, 256) == pytest.approx(0.2, abs=0.001)


def test_a_mould_is_solved_once():
    cast = seen(BOX, POSTS)
    assert cast.sites is cast.sites
    assert cast.density.sum() == pytest.approx(cast.n_cells)
    assert cast.image is cast.image
    with pytest.raises(RaptorError, match="holds no cell"):
        _ = seen(shapely.box(0.3, 0.3, 0.4, 0.4)).n_cells
