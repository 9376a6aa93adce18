import numpy as np
import pandas as pd
import pytest

from raptor.fields.metrics import BULK, bulk_statistics, field_pearson, nrmse, pearson, vrmse, without_sign
from raptor.studies.tradeoff import Reference, _resampled, summarise
from raptor.symmetry import FIELDS

pytestmark = pytest.mark.one_processor

RNG = np.random.default_rng(0)


def test_vrmse_of_the_targets_own_mean_is_one():
    target = RNG.normal(3, 2, (4, 8, 20, 20))
    mean = np.broadcast_to(target.mean(axis=(-2, -1), keepdims=True), target.shape)
    assert vrmse(mean, target) == pytest.approx(1)
    assert vrmse(target, target) == pytest.approx(0)
    assert nrmse(np.zeros_like(target), target) == pytest.approx(1)


def test_pearson():
    a = RNG.normal(size=50)
    assert pearson(a, 2 * a + 1) == pytest.approx(1)
    assert pearson(a, -a) == pytest.approx(-1)
    assert np.isnan(pearson(a, np.ones(50)))
    fields = RNG.normal(size=(8, 5, 5))
    assert field_pearson(fields, fields) == pytest.approx([1] * 8)


def test_bulk_statistics_are_means_over_pixels_and_over_cells():
    fields = np.zeros((8, 4, 4))
    fields[0, 0, :2] = 5.0
    fields[1, 0, 0] = 3.0
    found = bulk_statistics(fields, 10, 1.0)
    assert tuple(found) == BULK
    assert found["P"] == pytest.approx(10 / 16)
    assert found["N"] == 2
    assert found["T"] == pytest.approx(3 / 16)
    assert found["Tbar"] == pytest.approx(3 / 10)  # the mean over cells


def test_spontaneous_signs_are_left_out():
    fields = RNG.normal(size=(8, 3, 3))
    flipped = fields.copy()
    flipped[[FIELDS.index("sxsz"), FIELDS.index("sysz")]] *= -1
    assert np.array_equal(without_sign(fields), without_sign(flipped))
    assert np.array_equal(without_sign(fields)[:6], fields[:6])


def test_the_best_prediction_scores_one_and_another_run_root_two():
    truth = RNG.normal(size=(8, 1, 1)) * np.ones((8, 100, 100))
    runs = [truth + 0.3 * RNG.normal(size=truth.shape) for _ in range(6)]
    reference = Reference(runs[:5], np.arange(10.0).reshape(5, 2))
    assert reference.spread == pytest.approx(0.3, rel=0.02)
    assert reference.field_error(truth) == pytest.approx(1, rel=0.02)
    assert reference.field_error(runs[5]) == pytest.approx(np.sqrt(2), rel=0.02)
    assert reference.field_error(runs[0], 0) == pytest.approx(np.sqrt(2), rel=0.02)  # not against itself
    assert reference.shape_error(np.array([5.0, 5.0])) == pytest.approx([1, 0])
    assert reference.shape_error(np.array([0.0, 1.0]), 0) == pytest.approx([-5, -5])


def test_other_rasters_keep_the_sums():
    fields = RNG.uniform(size=(8, 16, 16))
    for pixels in (8, 16, 64):
        other = _resampled(fields, pixels)
        assert other.shape == (8, pixels, pixels)
        assert other.sum(axis=(1, 2)) == pytest.approx(fields.sum(axis=(1, 2)))


def test_a_summary_has_a_row_a_method():
    table = pd.DataFrame(
        {
            "case": ["a", "a", "b", "a"],
            "method": ["reference, seed 1", "reference, seed 2", "reference, seed 1", "standard"],
            "core_seconds": [1.0, 4.0, 2.0, 0.5],
            "cells": [100] * 4,
            "inverted_fraction": 0.0,
            "energy_above_best": [0.0, 0.1, 0.0, 0.2],
        }
        | {f"{name}_error": [1.0, -2.0, 3.0, 1.5] for name in ("density", "sxsx", "area", "width")}
    )
    summary = summarise(table).set_index("method")
    assert summary.index.tolist() == ["reference", "standard"]
    assert summary.loc["reference", "cases"] == 2
    assert summary.loc["reference", "core_seconds"] == pytest.approx(2.0)  # the geometric mean
    assert summary.loc["reference", "area_error"] == pytest.approx(2.0)  # of magnitudes
