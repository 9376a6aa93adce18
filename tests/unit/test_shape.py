import numpy as np
import pytest
import shapely

from raptor.fields.shape import area_ratio, width_ratio
from raptor.frame import pixel_centres
from raptor.moulds import Circle, Mould
from raptor.moulds.cast import CastMould, central_section
from raptor.raster import density_threshold

X, Y = np.meshgrid(pixel_centres(256), pixel_centres(256))


def smooth_box(half_x, half_y):
    """A density that crosses 1/2 exactly at the edges of a box."""

    def edge(u, half):
        return 1 / (1 + np.exp(np.clip((np.abs(u) - half) / 0.3, -50, 50)))

    return np.minimum(edge(X, half_x), edge(Y, half_y))


def seen(outline, tethers=()):
    return CastMould(Mould(outline, tethers), 1, 256)


def test_width_is_found_between_pixels():
    mould = seen(shapely.box(-20, -10, 20, 10))
    for half in (4.0, 4.03, 4.11, 7.77):
        assert width_ratio(smooth_box(15, half), mould, 0.5) == pytest.approx(half / 10, abs=2e-3)


def test_width_is_measured_across_the_long_side_whichever_it_is():
    tall = seen(shapely.box(-10, -20, 10, 20))
    assert width_ratio(smooth_box(6, 15), tall, 0.5) == pytest.approx(0.6, abs=2e-3)
    square = seen(shapely.box(-10, -10, 10, 10))  # x counts as the long side
    assert width_ratio(smooth_box(9, 5), square, 0.5) == pytest.approx(0.5, abs=2e-3)
    tilted = Mould(shapely.affinity.rotate(shapely.box(-20, -10, 20, 10), 30))
    (x0, y0), (x1, y1) = central_section(tilted).coords
    assert np.degrees(np.arctan2(y1 - y0, x1 - x0)) % 180 == pytest.approx(120, abs=1e-6)


def test_tethers_on_the_section_count_as_no_depression():
    mould = seen(shapely.box(-20, -10, 20, 10), (Circle(0, 0, 2),))
    assert width_ratio(smooth_box(15, 4), mould, 0.5) == pytest.approx(8 / 16, abs=2e-3)


def test_a_section_without_depression_has_no_width():
    posts = tuple(Circle(0, y, 1.3) for y in (-3.7, -1.3, 1.3, 3.7))
    assert np.isnan(width_ratio(smooth_box(1, 1), seen(shapely.box(-10, -5, 10, 5), posts), 0.5))


@pytest.mark.parametrize("layers", [1, 4, 7])
@pytest.mark.parametrize("pixels", [64, 128, 256])
def test_a_tissue_that_did_not_contract_keeps_area_and_width(layers, pixels):
    cast = CastMould(Mould(shapely.box(-20.5, -10.5, 20.5, 10.5)), layers, pixels)
    assert area_ratio(cast.density, cast) == pytest.approx(1, abs=0.06)
    assert width_ratio(cast.density, cast) == pytest.approx(1, abs=0.06)


def test_the_threshold_is_the_papers_at_its_scale():
    assert density_threshold(7, 256) == pytest.approx(0.2, abs=0.001)
