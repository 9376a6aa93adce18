"""Posteriors over the paper's region, and what another measurement would leave of them."""

import numpy as np
import pandas as pd
import pytest
import shapely
from scipy.stats import qmc

from raptor.condor.simulate import simulate
from raptor.core.errors import RaptorError
from raptor.fields.shape import shape_ratios
from raptor.fitting import (
    Sampled,
    Simulator,
    Survey,
    Target,
    infer,
    parameters_at,
    profile,
    rank_measurements,
    seen,
    simulate_draws,
    summarise,
    unit_of,
)
from raptor.fitting.experimental_design import expected_left
from raptor.fitting.measurements import SEEN, thickness_ratio
from raptor.fitting.posterior import interpolation_error
from raptor.fitting.targets import as_array, prior_density
from raptor.moulds import Mould
from raptor.moulds.cast import CastMould
from raptor.parameters import DELTA, KAPPA_NNN, KAPPA_NNNN, CellParameters, NetworkModel
from raptor.raster import rasterise
from tests.stand_ins import TRUTH, smooth

BOX = Mould(shapely.box(-12, -6, 12, 6))


def surveyed(points=128, sigma=0.01):
    units = qmc.Sobol(3, seed=3).random(points)
    parameters = [parameters_at(unit) for unit in units]
    values = np.full((points, len(SEEN)), np.nan)
    values[:, :2] = smooth(parameters)
    values[:, 2:] = as_array(parameters)[:, [0, 1, 2, 1, 2, 1]]
    return Survey(units, values, np.full((points, 2), sigma))


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


def test_a_corrected_survey_moves_the_posterior_to_where_the_simulator_has_it():
    """The surrogate is wrong by a constant; taking it away gives the posterior of one that is right."""
    found, wrong = surveyed(), np.array([0.03, np.nan])
    target = Target(*smooth([TRUTH])[0])
    biased = infer(found.shifted(wrong), target, 0, dense=2**12)
    right = infer(found.shifted(wrong).shifted(-wrong), target, 0, dense=2**12)
    assert right.weights == pytest.approx(infer(found, target, 0, dense=2**12).weights)
    assert abs(biased.weights - right.weights).max() > 1e-4
    assert smooth([parameters_at(right.middle)])[0] == pytest.approx(smooth([TRUTH])[0], abs=0.01)


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


def test_what_is_seen_does_not_turn_with_the_mould():
    little = CellParameters(0.2, 0.4, 0.2)  # so that there is tissue in every section
    made = simulate(BOX, little, NetworkModel(2), "draft", 0)
    fields = rasterise(made.positions, made.orientation, made.tension, 128)
    turned = fields.swapaxes(1, 2)[:, :, ::-1].copy()  # a quarter turn
    turned[2], turned[3], turned[5] = turned[3].copy(), turned[2].copy(), -turned[5]
    cast = CastMould(BOX, 2, 128)
    found = seen(fields, cast, cast.threshold)
    other = seen(turned, CastMould(Mould(shapely.box(-6, -12, 6, 12)), 2, 128), cast.threshold)
    assert found == pytest.approx(other, abs=1e-6)
    assert found[:2].tolist() == shape_ratios(fields[0], cast).tolist()
    assert 0 < thickness_ratio(made) < 1.1
