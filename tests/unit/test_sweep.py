import numpy as np
import pandas as pd
import pytest

from raptor.fields.directors import directors
from raptor.plotting import contraction_figure
from raptor.studies.outcomes import outcomes
from raptor.studies.sweep import contraction, differences, middle_points, read_panels, shown_deltas, tabulate
from raptor.symmetry import FIELDS, Element, apply
from tests.small import CAMPAIGN, build, design


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """A sweep of one mould of the library."""
    grid = {"delta": [0.2, 0.9], "kappa_nnn": [0.5], "ratio": [0.2, 0.5]}
    given = design("bench", moulds="small_rectangle", grid=grid, seeds=1, test=None, validation=0, edge=0)
    return build(tmp_path_factory.mktemp("sweep") / "bench", 4, given)


def test_a_table_holds_the_ratios_of_each_simulation(campaign):
    table = tabulate(campaign / "fields.nc")
    assert table["delta"].tolist() == [0.2, 0.2, 0.9, 0.9]
    assert table["ratio"].tolist() == [0.2, 0.5, 0.2, 0.5]
    assert table.groupby("delta")["area_ratio"].mean().is_monotonic_decreasing
    assert set(tabulate(CAMPAIGN / "fields.nc")["simulation"]) == set(range(24))


def test_moulds_without_a_family_are_groups_of_their_own():
    """As in a design of given moulds, of which a search wrote some."""
    simulated = pd.DataFrame(
        {
            "simulation": [0, 1, 2],
            "mould": ["a", "b", "c"],
            "delta": 0.5,
            "posts_lost": [0, 1, 0],
            "area_ratio": 0.7,
        }
    )
    design = pd.DataFrame({"simulation": [0, 1, 2], "family": ["designed", "designed", None]})
    table = outcomes(simulated, design, pd.Series({"a": 2, "b": 2, "c": 0})).set_index("group")
    assert table["simulations"].to_dict() == {"c": 1, "designed": 2}
    assert table["losing_posts"].loc["designed"] == 0.5
    assert np.isnan(table["losing_posts"].loc["c"])


def test_tissues_are_drawn_near_the_papers_deltas(campaign):
    assert shown_deltas([0.1, 0.45, 0.6, 0.95]) == (0.45, 0.95)
    assert shown_deltas([0.3]) == (0.3,)
    panels, thresholds = read_panels(campaign / "fields.nc", "small_rectangle")
    assert [panel.point for panel in panels] == [(d, 0.5, r) for d in (0.2, 0.9) for r in (0.2, 0.5)]
    assert list(thresholds) == ["simulated"]
    assert [panel.point for panel in middle_points(panels)] == [(0.2, 0.5, 0.5), (0.9, 0.5, 0.5)]


@pytest.fixture
def swept():
    """Two points and two seeds; the second point has no width, the third was not simulated."""
    simulated = pd.DataFrame(
        {
            "delta": [0.2, 0.2, 0.9, 0.9], "kappa_nnn": 0.1, "ratio": 0.1,
            "area_ratio": [0.8, 0.9, 0.5, 0.5], "width_ratio": [0.7, 0.7, np.nan, np.nan],
        }
    )  # fmt: skip
    predicted = pd.DataFrame(
        {
            "delta": [0.2, 0.9, 0.95], "kappa_nnn": 0.1, "ratio": 0.1, "area_ratio": [0.86, 0.4, 0.4],
            "width_ratio": [0.6, 0.3, 0.3], "area_ratio_band95": 0.05, "width_ratio_band95": 0.2,
            "out_of_distribution": [False, True, True],
        }
    )  # fmt: skip
    return contraction(*(table.assign(mould="one") for table in (simulated, predicted)))


def test_comparison_is_in_per_cent_of_contraction(swept):
    area = swept[swept["measure"] == "area"].set_index("delta")
    assert area["simulated"].tolist() == pytest.approx([15.0, 50.0, np.nan], nan_ok=True)
    assert area["predicted"].tolist() == pytest.approx([14.0, 60.0, 60.0])
    assert area.loc[0.2, "spread"] == pytest.approx(np.std([10, 20], ddof=1))
    assert area["seeds"].tolist() == [2, 2, 0]
    assert area["within_band"].tolist() == [True, False, False]


def test_the_largest_difference_and_where_it_is(swept):
    found = {entry["measure"]: entry for entry in differences(swept)}
    assert found["area"]["points"] == 2
    assert found["area"]["largest"]["difference"] == pytest.approx(10.0)
    assert found["area"]["largest"]["delta"] == 0.9
    assert found["area"]["mean_absolute"] == pytest.approx(5.5)
    assert found["area"]["within_band"] == 0.5
    assert found["width"]["points"] == 1
    assert found["width"]["largest"]["difference"] == pytest.approx(10.0)


def test_a_sweep_of_failed_simulations_has_no_difference(swept):
    (entry,) = differences(swept[(swept["delta"] == 0.95) & (swept["measure"] == "area")])
    assert entry == {"mould": "one", "measure": "area", "points": 0}


def test_curves_are_drawn_a_panel_a_mould_and_measure(swept):
    figure = contraction_figure(pd.concat([swept, swept.assign(mould="two")]))
    assert [axes.get_title() for axes in figure.axes[:2]] == ["One", "Two"]
    assert len(figure.axes) == 4


def fields_of(angles, weights):
    """Fields (8, y, x) of cells that lie in the plane, along some angles (n, y, x), with weights."""
    x, y = np.cos(angles), np.sin(angles)
    zero = np.zeros(angles.shape[1:])
    named = {
        "density": weights.sum(0), "tension": zero, "szsz": zero, "sxsz": zero, "sysz": zero,
        "sxsx": (weights * x * x).sum(0), "sysy": (weights * y * y).sum(0), "sxsy": (weights * x * y).sum(0),
    }  # fmt: skip
    return np.stack([named[name] for name in FIELDS])


@pytest.mark.parametrize("angle", [0.0, 0.3, -1.2, np.pi / 2])
def test_cells_along_one_line_have_it_as_their_director(angle):
    found = directors(fields_of(np.full((1, 8, 8), angle), np.full((1, 8, 8), 2.0)), 0.5, 4)
    assert found.centres.shape == (4,)
    assert found.angle == pytest.approx(angle)
    assert found.anisotropy == pytest.approx(1.0)


def test_cells_along_all_lines_have_none_and_places_without_tissue_are_unknown():
    angles = np.broadcast_to(np.linspace(0, np.pi, 6, endpoint=False)[:, None, None], (6, 4, 4))
    fields = fields_of(angles, np.ones((6, 4, 4)))
    assert directors(fields, 0.5, 4).anisotropy == pytest.approx(0.0, abs=1e-12)
    fields[:, :2] = 0.1
    found = directors(fields, 0.5, 4).anisotropy
    assert np.isnan(found[:2]).all()
    assert np.isfinite(found[2:]).all()


@pytest.mark.parametrize("element", Element.all(), ids=str)
def test_directors_of_a_turned_tissue_are_turned(element):
    rng = np.random.default_rng(3)
    fields = fields_of(rng.uniform(0, np.pi, (3, 8, 8)), rng.uniform(1, 2, (3, 8, 8)))
    there = directors(fields, 0.1, 8)
    moved = directors(apply(fields, element), 0.1, 8)
    turned = np.pi / 2 * element.quarter_turns + (np.pi - there.angle if element.mirror else there.angle)
    places = np.rot90(np.flip(turned, -1) if element.mirror else turned, -element.quarter_turns)
    assert np.sin(moved.angle - places) == pytest.approx(0.0, abs=1e-9)
