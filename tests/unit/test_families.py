"""Moulds that people cast: every family and layout draws what can be cast, again and again the same."""

import numpy as np
import pytest
import shapely

from raptor.core.errors import RaptorError
from raptor.moulds import Circle
from raptor.moulds.families import MARGIN, MouldFamilies
from raptor.moulds.outlines import OUTLINES, irregular
from raptor.moulds.tether_layouts import LAYOUTS

pytestmark = pytest.mark.one_processor

RULES = MouldFamilies()


def draw(seed, rules=RULES):
    return rules.draw(np.random.default_rng([11, seed]), 7, f"m{seed}")


@pytest.mark.parametrize("name", OUTLINES)
def test_an_outline_is_a_simple_polygon_of_moderate_aspect(name):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        for outline in (polygon := OUTLINES[name](rng), irregular(rng, polygon, 0.03)):
            assert outline.geom_type == "Polygon"
            assert outline.is_valid
            assert not outline.interiors
            x0, y0, x1, y1 = outline.bounds
            assert max(x1 - x0, y1 - y0) < 5.6 * min(x1 - x0, y1 - y0)


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_layout_gives_tethers_that_stand_in_a_plain_rectangle(name):
    box = shapely.box(-26, -13, 26, 13)
    found = [LAYOUTS[name](np.random.default_rng(seed), box) for seed in range(20)]
    assert name == "none" or sum(map(len, found)) >= 20
    standing = [tether.stands_in(box) for tethers in found for tether in tethers]
    assert name == "none" or np.mean(standing) > 0.8


def test_drawn_moulds_keep_their_bounds():
    for seed in range(40):
        mould = draw(seed)
        assert mould.family in OUTLINES
        assert RULES.cells[0] <= 7 * mould.depression.area <= RULES.cells[1]
        assert max(map(abs, mould.outline.bounds)) <= 31.25 - MARGIN + 1e-9
        assert mould.depression.geom_type == "Polygon"
        assert draw(seed) == mould


def test_weights_choose_families_and_layouts():
    rules = MouldFamilies(families={"cross": 1.0}, layouts={"middle": 1.0})
    for seed in range(5):
        mould = draw(seed, rules)
        assert mould.family == "cross"
        assert len(mould.tethers) == 1
        assert isinstance(mould.tethers[0], Circle)
    with pytest.raises(ValueError, match="families has 'crosses'; known are rectangle"):
        MouldFamilies(families={"crosses": 1.0})
    with pytest.raises(RaptorError, match="no mould of the family star with 10 to 20 cells"):
        draw(0, MouldFamilies(cells=(10, 20), families={"star": 1.0}))
