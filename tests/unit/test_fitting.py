"""Fits, posteriors and outlines, on smooth stand-ins for tissues."""

import json

import numpy as np
import pandas as pd
import pytest
import shapely
from PIL import Image
from scipy.stats import qmc

from raptor.condor.simulate import simulate
from raptor.core.errors import RaptorError
from raptor.fields.shape import shape_ratios
from raptor.fitting import (
    Outline,
    Sampled,
    Simulator,
    Survey,
    Target,
    correct,
    descend_by_simulation,
    deviations,
    distances,
    fit,
    fit_joint,
    infer,
    measure_again,
    minimise,
    outline_measure,
    outline_of,
    parameters_at,
    profile,
    rank_measurements,
    read_outline,
    seen,
    simulate_draws,
    summarise,
    tabulate,
    tabulate_joint,
    unit_of,
    write_fit,
)
from raptor.fitting.experimental_design import expected_left
from raptor.fitting.measurements import SEEN, thickness_ratio
from raptor.fitting.posterior import interpolation_error
from raptor.fitting.targets import as_array, prior_density
from raptor.frame import pixel_centres
from raptor.moulds import Mould
from raptor.moulds.cast import CastMould
from raptor.parameters import DELTA, KAPPA_NNN, KAPPA_NNNN, CellParameters, NetworkModel
from raptor.raster import rasterise

TRUTH = CellParameters(0.6, 0.4, 0.2)
BOX = Mould(shapely.box(-12, -6, 12, 6))


def smooth(parameters):
    """A stand-in for a tissue: both ratios fall with delta, each with a stiffness of its own."""
    return np.array(
        [
            (
                1 - 0.6 * p.delta * (1 - 0.5 * p.kappa_nnn),
                1 - 0.8 * p.delta * (1 - 0.3 * p.kappa_nnnn),
            )
            for p in parameters
        ]
    )


def ellipse(parameters, pixels=128):
    """Densities (n, y, x) of stand-ins whose two half axes and waist show a parameter each."""
    x, y = np.meshgrid(pixel_centres(pixels), pixel_centres(pixels))
    images = []
    for p in parameters:
        height = 12 * (1 - 0.5 * p.delta) * (1 - p.kappa_nnnn * np.exp(-((x / 6) ** 2)))
        radius = np.hypot(x / (24 * (1 - 0.5 * p.kappa_nnn)), y / height)
        images.append(1 / (1 + np.exp(10 * (radius - 1))))
    return np.array(images)


def surveyed(points=128, sigma=0.01):
    units = qmc.Sobol(3, seed=3).random(points)
    parameters = [parameters_at(unit) for unit in units]
    values = np.full((points, len(SEEN)), np.nan)
    values[:, :2] = smooth(parameters)
    values[:, 2:] = as_array(parameters)[:, [0, 1, 2, 1, 2, 1]]
    return Survey(units, values, np.full((16, 2), sigma))


def test_the_unit_cube_is_the_papers_region():
    for unit in np.random.default_rng(0).random((200, 3)):
        parameters = parameters_at(unit).require_sampled("fit")
        assert unit_of(parameters) == pytest.approx(unit)
    low, high = parameters_at(np.zeros(3)), parameters_at(np.ones(3))
    assert as_array([low])[0].tolist() == [DELTA.lower, KAPPA_NNN.lower, KAPPA_NNNN.lower]
    assert as_array([high])[0].tolist() == [DELTA.upper, KAPPA_NNN.upper, KAPPA_NNNN.upper]


def test_the_prior_is_uniform_over_the_kappas_plane():
    """Their mean is the centroid of the bounded plane, a trapezoid cut at the upper bound."""
    units = qmc.Sobol(3, seed=0).random(2**14)
    weights = prior_density(units)
    mean = weights / weights.sum() @ as_array([parameters_at(unit) for unit in units])
    edge = KAPPA_NNN.upper / np.sqrt(2)
    corners = [(0.1, 0.01), (0.71, 0.01), (0.71, min(edge, 0.5)), (0.1, 0.1 / np.sqrt(2))]
    centroid = shapely.Polygon(corners).centroid
    assert mean == pytest.approx([0.5, centroid.x, centroid.y], abs=3e-3)


def test_a_fit_finds_a_tissue_and_says_what_is_not_determined():
    area, width = smooth([TRUTH])[0]
    fitted = fit(smooth, Target(area, width), starts=32, seed=0)
    assert fitted.rss < 1e-8
    assert (fitted.area_ratio, fitted.width_ratio) == pytest.approx((area, width), abs=1e-3)
    assert fitted.rank == 2  # two numbers, three parameters
    fitted.parameters.require_sampled("fit")


def test_a_finer_model_refines_what_a_coarse_one_starts():
    def coarse(parameters):
        return smooth(parameters) + 0.02

    target = Target(*smooth([TRUTH])[0])
    fitted = fit(coarse, target, starts=32, seed=0, fine=smooth)
    assert fitted.rss < 1e-8
    assert target.rss(smooth([fitted.parameters])[0]) < 1e-8


def test_a_fit_without_area_uses_the_width_alone():
    fitted = fit(smooth, Target(None, 0.7), starts=32, seed=0)
    assert fitted.width_ratio == pytest.approx(0.7, abs=1e-3)
    assert fitted.rank == 1


def test_a_fit_leaves_a_flat_corner():
    """Near a lower bound steps keep their size: pixels count, so tiny steps would see nothing."""

    def stepped(parameters):
        return np.round(smooth(parameters), 2)

    area, width = smooth([TRUTH])[0]
    assert fit(stepped, Target(area, width), starts=32, seed=0).rss < 2e-4


def test_a_fit_of_nothing_measurable_is_named():
    def nothing(parameters):
        return np.full((len(parameters), 2), np.nan)

    with pytest.raises(RaptorError, match="none of the measured ratios"):
        fit(nothing, Target(None, 0.5), starts=16, seed=0)
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


def test_a_posterior_shows_the_valley():
    """Two numbers leave a curve of the region: its ends fit as well as the truth."""
    target = Target(*smooth([TRUTH])[0])
    posterior = infer(surveyed(), target, seed=0, dense=2**13)
    assert posterior.weights.sum() == pytest.approx(1)
    summary = summarise(posterior)
    assert summary["reachable"]
    assert summary["least_chi2"] < 0.1
    delta, nnn = (summary["parameters"][name] for name in ("delta", "kappa_nnn"))
    assert delta["quantiles"]["0.025"] < TRUTH.delta < delta["quantiles"]["0.975"]
    assert delta["std"] < 0.3 * delta["prior_std"]
    assert summary["parameters"]["kappa_nnnn"]["std"] > 0.5 * summary["parameters"]["kappa_nnnn"]["prior_std"]
    left = [direction["left"] for direction in summary["directions"]]
    assert left == sorted(left)
    assert left[0] < 0.15 < 0.5 < left[2]
    assert nnn["profile_interval"]["lower"] < TRUTH.kappa_nnn < nnn["profile_interval"]["upper"]
    alone = summarise(infer(surveyed(), Target(None, target.width_ratio), seed=0, dense=2**13))
    assert alone["part_of_region"] > summary["part_of_region"]
    assert alone["determined"] <= summary["determined"]
    values, heights = profile(posterior, "delta")
    assert heights.max() == 0
    assert values[heights.argmax()] == pytest.approx(TRUTH.delta, abs=0.1)


def test_the_surrogates_error_widens_intervals():
    target = Target(*smooth([TRUTH])[0])
    widths = [
        summarise(infer(surveyed(sigma=sigma), target, 0, 0.01, 2**13))["parameters"]["delta"]["std"]
        for sigma in (0.0, 0.05)
    ]
    assert widths[1] > 1.5 * widths[0]


def test_a_posterior_is_that_of_plain_quadrature():
    target, error = Target(*smooth([TRUTH])[0]), 0.02
    units = np.random.default_rng(1).random((20000, 3))
    parameters = [parameters_at(unit) for unit in units]
    squares = (target.residuals(smooth(parameters)) ** 2).sum(axis=1) / error**2
    weights = prior_density(units) * np.exp(-0.5 * squares)
    mean = weights / weights.sum() @ as_array(parameters)
    posterior = infer(surveyed(sigma=0.0), target, 0, error, 2**14)
    assert posterior.weights @ posterior.parameters == pytest.approx(mean, abs=0.01)
    assert (interpolation_error(surveyed())[:2] < 3e-3).all()


def test_what_the_model_cannot_make_is_said():
    summary = summarise(infer(surveyed(), Target(0.95, 0.3), seed=0, dense=2**12))
    assert not summary["reachable"]
    nothing = surveyed()
    nothing.values[:, 1] = np.nan
    with pytest.raises(RaptorError, match="cannot be computed everywhere"):
        infer(nothing, Target(None, 0.5), 0, 0.01, 2**12)
    assert summarise(infer(nothing, Target(0.7, None), 0, 0.01, 2**12))["reachable"]


def test_what_a_measurement_leaves_is_that_of_normal_theory():
    """Of a normal prior, a measurement with its own deviation as error leaves 1 / sqrt 2."""
    generator = np.random.default_rng(0)
    parameters = generator.standard_normal((4000, 2))
    left = expected_left(parameters, parameters[:, :1], np.ones(1), generator)
    assert left == pytest.approx([np.sqrt(0.5), 1], abs=0.05)


def test_measurements_are_ranked_by_what_they_leave():
    posterior = infer(surveyed(), Target(*smooth([TRUTH])[0]), seed=0, dense=2**13)
    nothing = Sampled(np.empty((0, 3)), pd.DataFrame(columns=[*SEEN, "thickness"]))
    table = rank_measurements(posterior, nothing, Target(*smooth([TRUTH])[0]), 0)
    assert table["measurement"].tolist()[0] == "outline"  # shows all three parameters here
    assert set(table["measurement"]) == {"outline", "alignment", "upright", "tension"}
    assert table["left"].is_monotonic_increasing
    assert table["left"].between(0, 1.05).all()


def test_simulated_draws_tell_thickness_and_errors():
    posterior = infer(surveyed(), Target(*smooth([TRUTH])[0]), seed=0, dense=2**12)
    simulator = Simulator(NetworkModel(2), "draft", 32, 5)
    sampled = simulate_draws(posterior, simulator, BOX, 5)
    assert sampled.table["thickness"].between(0.3, 1.2).all()
    assert np.ptp(sampled.units @ np.ones(3)) > 0
    table = rank_measurements(posterior, sampled, Target(*smooth([TRUTH])[0]), 0)
    errors = table.set_index("measurement")["model_error"]
    assert "thickness" in errors.index
    assert (errors > 0).all()


def test_simulations_again_have_seeds_of_their_own():
    simulator = Simulator(NetworkModel(2), "draft", 64, 5)
    runs = simulator.replicates(BOX, TRUTH, 2)
    target = Target(0.7, 0.7)
    again = measure_again(runs, simulator, BOX, target)
    assert again["area_ratio_std"] > 0
    assert again["runs"] == 2
    measured = simulator.measure(BOX)([TRUTH])
    assert measured[0].tolist() == simulator.measure(BOX)([TRUTH])[0].tolist()
    assert again["area_ratio"] == pytest.approx(measured[0, 0], abs=0.2)


def test_what_is_seen_does_not_turn_with_the_mould():
    made = simulate(BOX, TRUTH, NetworkModel(2), "draft", 0)
    fields = rasterise(made.positions, made.orientation, made.tension, 128)
    turned = fields.swapaxes(1, 2)[:, :, ::-1].copy()  # a quarter turn
    turned[2], turned[3], turned[5] = turned[3].copy(), turned[2].copy(), -turned[5]
    cast = CastMould(BOX, 2, 128)
    found = seen(fields, cast, cast.threshold)
    other = seen(turned, CastMould(Mould(shapely.box(-6, -12, 6, 12)), 2, 128), cast.threshold)
    assert found == pytest.approx(other, abs=1e-6)
    assert found[:2].tolist() == shape_ratios(fields[0], cast).tolist()
    assert 0 < thickness_ratio(made) < 1.1


def test_distances_to_an_outline_are_signed_and_finer_than_a_pixel():
    x, y = np.meshgrid(pixel_centres(64), pixel_centres(64))
    circles = {radius: radius - np.hypot(x, y) for radius in (10.0, 10.3)}
    outline = outline_of(circles[10.0], 0.0)
    assert len(outline.points) == pytest.approx(128, abs=1)
    assert outline.length == pytest.approx(20 * np.pi, rel=0.01)
    assert distances(outline, circles[10.3], 0.0) == pytest.approx(0.3, abs=0.02)
    assert distances(outline_of(circles[10.3], 0.0), circles[10.0], 0.0) == pytest.approx(-0.3, abs=0.02)
    assert np.isnan(distances(outline, 0 * x, 1.0)).all()


def test_an_outline_determines_what_ratios_leave_open():
    outline = outline_of(ellipse([TRUTH])[0], 0.5)
    measure = outline_measure(ellipse, outline, 0.5)
    found = minimise(measure, lambda measured: measured, starts=16, seed=0)
    assert found.rank == 3
    assert as_array([found.parameters])[0] == pytest.approx(as_array([TRUTH])[0], abs=0.02)
    errors = deviations(measure, found, outline, 0.1)
    assert (errors < 0.1).all()
    flat = outline_measure(lambda parameters: ellipse([TRUTH] * len(parameters)), outline, 0.5)
    assert np.isinf(deviations(flat, found, outline, 0.1)).all()


def test_an_outline_is_read_from_a_picture(tmp_path):
    density = ellipse([TRUTH], 256)[0]
    wanted = outline_of(density, 0.5)
    for name, values in (("dark.png", 1 - density), ("bright.png", density)):
        Image.fromarray((255 * values[::-1]).astype(np.uint8)).save(tmp_path / name)
        found = read_outline(tmp_path / name)
        assert np.abs(distances(found, density, 0.5)).max() < 0.3
        assert found.length == pytest.approx(wanted.length, rel=0.02)
    for content, message in (
        (Image.new("L", (64, 32)), "crop it to the square frame"),
        (Image.new("L", (64, 64)), "has one colour"),
    ):
        content.save(tmp_path / "bad.png")
        with pytest.raises(RaptorError, match=message):
            read_outline(tmp_path / "bad.png")
    (tmp_path / "bad.png").write_bytes(b"no picture")
    with pytest.raises(RaptorError, match="no picture"):
        read_outline(tmp_path / "bad.png")


def test_an_outline_of_several_pieces_has_points_on_each():
    pieces = shapely.MultiPolygon([shapely.box(-5, -5, 0, 5), shapely.box(10, 10, 20, 20)])
    outline = Outline.along(pieces, 70)
    assert outline.length == pytest.approx(70)
    assert (outline.points[:, 0] > 9).sum() == pytest.approx(40, abs=1)


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
