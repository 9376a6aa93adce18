import numpy as np
import pandas as pd
import pytest

from raptor.config import Configuration, load
from raptor.core.errors import RaptorError
from raptor.dataset.run import simulate_shard
from raptor.dataset.shards import write_shard
from raptor.dataset.sweep import Grid, sweep_runs
from raptor.fields.directors import directors
from raptor.fields.shape import shape_ratios
from raptor.plotting import contraction_figure
from raptor.studies.sweep import compare, differences, measure, middle_points, point_of
from raptor.symmetry import FIELDS, Element, apply
from tests.small import MODEL

GRID = Grid((0.2, 0.9), (0.1, 0.7), (0.1, 0.7), seeds=2)
CORNER = (0.9, 0.1, 0.1)


@pytest.mark.parametrize("name", ["laptop", "paper"])
def test_the_hardest_corner_is_swept(pytestconfig, name):
    sweep = load(pytestconfig.rootpath / "config" / f"{name}.yaml").sweep
    assert CORNER in sweep.grid().points
    assert list(sweep.files()) == ["four_post_rectangle", "i_shape"]
    assert sweep.panels == (0.5, 0.9)


def test_a_sweep_has_every_point_as_often_as_asked_and_seeds_of_its_own(small_mould):
    runs = sweep_runs(GRID, small_mould, 1)
    assert [run.simulation for run in runs] == list(range(GRID.size))
    assert len({run.seed for run in runs}) == GRID.size == 16
    points = [point_of(run.parameters) for run in runs]
    assert set(points) == set(GRID.points)
    assert all(points.count(point) == 2 for point in points)
    assert runs == sweep_runs(GRID, small_mould, 1)
    assert {run.seed for run in runs}.isdisjoint(run.seed for run in sweep_runs(GRID, small_mould, 2))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (((0.97,), (0.1,), (0.1,)), "delta is 0.97"),
        (((0.5,), (0.05,), (0.5,)), "kappa_nnn is 0.05"),
        (((0.5,), (0.1,), (0.05,)), "kappa_nnnn is 0.005"),
        (((0.5,), (0.5,), (0.8,)), "above kappa_nnn/sqrt"),
    ],
)
def test_points_outside_of_what_is_learnt_are_refused(values, message):
    with pytest.raises(RaptorError, match=message):
        Grid(*values)


def test_a_sweep_changes_no_other_fingerprint_nor_do_moulds_and_panels_its_own():
    plain = Configuration()
    swept = Configuration.model_validate({"sweep": {"seeds": 3}})
    drawn = Configuration.model_validate({"sweep": {"panels": [0.9], "moulds": []}})
    for stage in ("design", "simulation", "dataset"):
        assert plain.fingerprint(stage) == swept.fingerprint(stage)
    assert plain.sweep_fingerprint() == drawn.sweep_fingerprint() != swept.sweep_fingerprint()


def test_middle_points_are_points():
    assert middle_points(GRID, (0.9,)) == [(0.9, 0.7, 0.7)]
    assert set(middle_points(GRID, GRID.deltas)) <= set(GRID.points)


def test_measured_are_the_ratios_of_each_simulation(small_mould, tmp_path):
    runs = sweep_runs(Grid((0.2, 0.9), (0.5,), (0.5,)), small_mould, 1)
    simulations, _ = simulate_shard(runs, {small_mould.name: small_mould}, MODEL, "draft")
    write_shard(tmp_path / "0.nc", runs, simulations, MODEL, "draft", "c", {})
    table = measure([tmp_path / "0.nc"], small_mould, MODEL.layers, 64)
    assert table["delta"].tolist() == [0.2, 0.9]
    assert table["area_ratio"].is_monotonic_decreasing
    from raptor.moulds.cast import CastMould
    from raptor.raster import rasterise

    s = simulations[1]
    density = rasterise(s.positions, s.orientation, s.tension, 64)[0]
    assert table.loc[1, ["area_ratio", "width_ratio"]].tolist() == pytest.approx(
        shape_ratios(density, CastMould(small_mould, MODEL.layers, 64)), abs=0.01
    )


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
            "unlike": [False, True, True],
        }
    )  # fmt: skip
    return compare("one", simulated, predicted)


def test_comparison_is_in_per_cent_of_contraction(swept):
    area = swept[swept["measure"] == "area"].set_index("delta")
    assert area["simulated"].tolist() == pytest.approx([15.0, 50.0, np.nan], nan_ok=True)
    assert area["predicted"].tolist() == pytest.approx([14.0, 60.0, 60.0])
    assert area.loc[0.2, "spread"] == pytest.approx(np.std([10, 20], ddof=1))
    assert area["seeds"].tolist() == [2, 2, 0]
    assert area["held"].tolist() == [True, False, False]


def test_the_largest_difference_and_where_it_is(swept):
    found = {entry["measure"]: entry for entry in differences(swept)}
    assert found["area"]["points"] == 2
    assert found["area"]["largest"]["difference"] == pytest.approx(10.0)
    assert found["area"]["largest"]["delta"] == 0.9
    assert found["area"]["mean_absolute"] == pytest.approx(5.5)
    assert found["area"]["held"] == 0.5
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
