"""Least squares by a surrogate and by the simulator, and their tables."""

import json
from dataclasses import asdict

import numpy as np
import pytest
import shapely

from raptor.core.errors import RaptorError
from raptor.fitting import (
    Fit,
    Simulator,
    Target,
    correct,
    descend_by_simulation,
    fit_joint,
    measure_again,
    minimise,
    parameters_at,
    tabulate,
    tabulate_joint,
    unit_of,
    write_fit,
)
from raptor.fitting.targets import as_array, surrogate_measure
from raptor.fitting.tissue import common_error
from raptor.moulds import Mould
from raptor.parameters import CellParameters, NetworkModel
from raptor.surrogate.files import load
from tests.stand_ins import TRUTH, smooth, untrained

BOX = Mould(shapely.box(-12, -6, 12, 6))


def fit(measure, target, **how):
    """The minimum of a model of area and width ratio, as a fit."""
    return Fit.at(minimise(measure, target.residuals, seed=0, **how))


def test_a_fit_finds_a_tissue_and_says_what_is_not_determined():
    area, width = smooth([TRUTH])[0]
    fitted = fit(smooth, Target(area, width), starts=32)
    assert fitted.rss < 1e-8
    assert (fitted.area_ratio, fitted.width_ratio) == pytest.approx((area, width), abs=1e-3)
    assert fitted.rank == 2  # two numbers, three parameters
    fitted.parameters.require_sampled("fit")


def test_the_error_common_to_a_mould_is_that_at_the_corrected_fit(tmp_path):
    surrogate = load(untrained(tmp_path))
    (predicted,) = surrogate_measure(surrogate, BOX, averaged=True)([TRUTH])
    at_fit = {"area_ratio": predicted[0] + 0.02, "width_ratio": None}  # torn at its section
    content = {"corrected": {"parameters": asdict(TRUTH)}, "corrected_simulation": at_fit}
    area, width = common_error(surrogate, BOX, content)
    assert area == pytest.approx(0.02)
    assert np.isnan(width)


def test_a_finer_model_refines_what_a_coarse_one_starts():
    def coarse(parameters):
        return smooth(parameters) + 0.02

    target = Target(*smooth([TRUTH])[0])
    fitted = fit(coarse, target, starts=32, fine=smooth)
    assert fitted.rss < 1e-8
    assert target.rss(smooth([fitted.parameters])[0]) < 1e-8


def test_a_fit_without_area_uses_the_width_alone():
    fitted = fit(smooth, Target(None, 0.7), starts=32)
    assert fitted.width_ratio == pytest.approx(0.7, abs=1e-3)
    assert fitted.rank == 1


def test_a_fit_leaves_a_flat_corner():
    """Near a lower bound steps keep their size: pixels count, so tiny steps would see nothing."""

    def stepped(parameters):
        return np.round(smooth(parameters), 2)

    area, width = smooth([TRUTH])[0]
    assert fit(stepped, Target(area, width), starts=32).rss < 2e-4


def test_a_fit_of_nothing_measurable_is_named():
    def nothing(parameters):
        return np.full((len(parameters), 2), np.nan)

    with pytest.raises(RaptorError, match="none of the measured ratios"):
        fit(nothing, Target(None, 0.5), starts=16)
    with pytest.raises(RaptorError, match="at the start of the search"):
        descend_by_simulation(nothing, Target(None, 0.5).residuals, np.full(3, 0.5), 9)


@pytest.mark.parametrize("budget", [1, 2, 6])
def test_few_simulations_correct_a_surrogate_that_errs(budget):
    """The stand-in simulator contracts more than the surrogate, and more so where both contract much."""
    asked = []

    def simulated(parameters):
        asked.extend(parameters)
        return smooth(parameters) ** 1.2 - 0.01

    target = Target(*(smooth([TRUTH]) ** 1.2 - 0.01)[0])
    found = minimise(smooth, target.residuals, starts=32, seed=0)
    before = target.rss(smooth([found.parameters])[0] ** 1.2 - 0.01)
    corrected = correct(found, smooth, simulated, target.residuals, budget=budget, enough=1e-7)
    assert corrected.evaluations == len(asked) <= budget
    assert corrected.rss == pytest.approx(target.rss(simulated([corrected.parameters])[0]))
    assert corrected.rss <= before + 1e-12
    if budget == 6:
        assert before > 1e-4
        assert corrected.rss < 1e-6
        assert corrected.rank == 2


def test_a_correction_ends_where_nothing_can_be_measured():
    def nothing(parameters):
        return np.full((len(parameters), 2), np.nan)

    target = Target(0.7, 0.6)
    found = minimise(smooth, target.residuals, starts=32, seed=0)
    corrected = correct(found, smooth, nothing, target.residuals, budget=6, enough=1e-7)
    assert (corrected.evaluations, corrected.rss) == (1, np.inf)


@pytest.mark.parametrize("budget", [1, 4, 6, 30])
def test_a_fit_by_the_simulator_keeps_its_budget_and_ends_in_the_noise(budget):
    """A rough stand-in, as common random numbers leave one, seen once at each point."""
    asked = []

    def rough(parameters):
        asked.extend(parameters)
        return smooth(parameters) + 1e-3 * np.sin(1e3 * as_array(parameters)[:, :2])

    target = Target(*smooth([TRUTH])[0])
    start = unit_of(CellParameters(0.4, 0.3, 0.1))
    found = descend_by_simulation(rough, target.residuals, start, budget)
    assert found.evaluations == len(asked) == len(set(asked)) <= budget
    assert found.rss <= target.rss(rough([parameters_at(start)])[0]) + 1e-12
    if budget == 30:
        assert found.rss < 1e-5
        assert found.rank == 2


def test_a_joint_fit_serves_all_tissues_alike():
    def other(parameters):
        return smooth(parameters) ** 2

    measures = [smooth, other]
    targets = {"one": Target(*smooth([TRUTH])[0]), "two": Target(None, other([TRUTH])[0, 1])}
    found = fit_joint(targets, measures, measures, measures, starts=32, seed=0, budget=9)
    assert set(found["surrogate"]["tissues"]) == {"one", "two"}
    assert found["surrogate"]["rss"] < 1e-8
    assert found["simulator"]["rss"] < 1e-5
    assert found["simulator"]["evaluations"] <= 9
    alone = fit_joint(targets, measures, measures, measures, starts=32, seed=0, budget=0)
    assert alone["simulator"] is None


def test_simulations_again_have_seeds_of_their_own():
    simulator = Simulator(NetworkModel(2), "draft", 64, 5)
    runs = simulator.replicates(BOX, TRUTH, 2)
    own = simulator.run(BOX, TRUTH)
    assert not any(np.array_equal(own.positions, each.positions) for each in runs)
    target = Target(0.7, 0.7)
    again = measure_again(runs, simulator, BOX, target)
    assert again["area_ratio_std"] > 0
    assert again["runs"] == 2
    measured = simulator.measure(BOX)([TRUTH])
    assert measured[0].tolist() == simulator.measure(BOX)([TRUTH])[0].tolist()
    assert again["area_ratio"] == pytest.approx(measured[0, 0], abs=0.2)


def content(tissue, delta):
    ratios = {"area_ratio": 0.8, "width_ratio": 0.7}
    parameters = {"delta": delta, "kappa_nnn": 0.5, "kappa_nnnn": 0.2}
    fitted = {"parameters": parameters, **ratios, "rss": 0.0, "rank": 2, "evaluations": 9}
    again = ratios | {"rss": 1e-4, "area_ratio_std": 0.0, "width_ratio_std": 0.0, "rss_std": 0.0}
    paper = parameters | ratios
    seconds = {f"{name}_seconds": 1.0 for name in ("surrogate", "corrected", "simulator")}
    return {
        "tissue": tissue, "target": ratios, "surrogate": fitted, "simulation": again, "paper": paper,
        "fit": fitted, "corrected": fitted, "corrected_simulation": again,
    } | seconds  # fmt: skip


def test_tables_hold_every_fit_in_columns_of_its_own(tmp_path):
    fits = [content("a", 0.2), content("b", 0.4)]
    table = tabulate(fits, fits[:1])
    assert table["surrogate_again_rss"].tolist() == [1e-4, 1e-4]
    assert table["simulator_delta"].notna().tolist() == [True, False]
    assert table["paper_simulation_rss"].tolist() == [0, 0]
    joint = {"targets": {"a": {}, "b": {}}, "surrogate": fits[0]["surrogate"], "simulator": None}
    rows = tabulate_joint(joint, fits).set_index("fit")
    assert rows.loc["separate, mean", "delta"] == pytest.approx(0.3)
    assert rows.loc["paper, standard deviation", "delta"] == pytest.approx(0.2 / np.sqrt(2))
    write_fit(tmp_path / "fit.json", {"a": np.float64("inf"), "b": [np.int64(3)]})
    assert json.loads((tmp_path / "fit.json").read_text()) == {"a": None, "b": [3]}
