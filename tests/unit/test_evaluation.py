"""Bands hold their share, flags fire, and the noise floor is what it says."""

import re
import shutil
from dataclasses import dataclass, replace
from itertools import pairwise

import netCDF4
import numpy as np
import pandas as pd
import pytest
import shapely
import torch
from scipy.ndimage import gaussian_filter

from raptor.core.errors import RaptorError
from raptor.dataset.design import read_design
from raptor.dataset.examples import (
    Example,
    join_examples,
    list_examples,
    training_rows,
    training_scaling,
    transform_sample,
)
from raptor.dataset.stack import read_samples, read_table
from raptor.fields.directors import anisotropy
from raptor.fields.resample import block_average
from raptor.fields.shape import shape_ratios
from raptor.frame import pixel_centres, pixel_size
from raptor.moulds import Mould, moulds_by_id
from raptor.moulds.cast import CastMould
from raptor.raster import density_threshold, rasterise
from raptor.studies.active_learning import disagreement_of
from raptor.studies.evaluation import by_region, evaluate, in_floors, noise_floor, predictor_of, summarise
from raptor.studies.scores import summary_of
from raptor.surrogate.bands import LEVELS, MEASURED, Bands, fit_scale
from raptor.surrogate.baselines import Nearest, baseline, training_mean
from raptor.surrogate.batches import ExampleSet
from raptor.surrogate.calibration import Case, calibrate, fit_threshold
from raptor.surrogate.costs import costs_of
from raptor.surrogate.ensemble import Realisations
from raptor.surrogate.files import load, save
from raptor.surrogate.generator import Generator
from raptor.surrogate.inference import Surrogate
from raptor.surrogate.out_of_distribution import DESCRIPTORS, TrainingSet, descriptors
from raptor.surrogate.rules import Architecture
from raptor.symmetry import FIELDS, Element
from tests.small import MODEL, build, design

DRAWN = {"test": None, "validation": 0, "edge": 0}
"""Keys of a campaign that holds out all of its runs."""


@pytest.fixture(scope="module")
def stack(made):
    return made / "fields.nc"


@pytest.fixture(scope="module")
def moulds(made):
    return moulds_by_id(made / "moulds.geojson")


@pytest.fixture(scope="module")
def surrogate(stack, moulds):
    """Two untrained networks, calibrated."""
    torch.manual_seed(0)
    architecture, scaling = Architecture(pixels=32, base_channels=4), training_scaling(stack)
    members = tuple(Generator(architecture, scaling).eval() for _ in range(2))
    plain = Surrogate(members, architecture, scaling, MODEL.layers, 32)
    return replace(plain, calibration=calibrate(plain, {stack: moulds}, 0))


def test_bands_hold_their_share_of_errors_like_those_they_were_fitted_to():
    rng = np.random.default_rng(0)
    spread, size = rng.gamma(2.0, 1.0, (2, 40_000, 3))
    error = rng.standard_t(3, (40_000, 3)) * np.hypot(spread, 0.3 * size) * np.array([0.1, 1, 10])
    half = 20_000
    scale = fit_scale(error[:half], spread[:half], size[:half])
    bands = scale.bands(spread[half:].T, size[half:].T)
    held = bands.hold(error[half:].T)
    assert held.mean(axis=2) == pytest.approx(np.tile(LEVELS, (3, 1)).T, abs=0.01)
    assert (np.diff(bands.half, axis=0) > 0).all()


def test_a_band_of_few_errors_is_wider_than_their_quantile():
    error = np.arange(1.0, 20.0)[:, None]
    scale = fit_scale(error, np.zeros_like(error), np.ones_like(error))
    half = scale.bands(np.zeros(1), np.ones(1)).half[:, 0]
    assert half[0] == pytest.approx(10)
    assert half[2] == pytest.approx(19)
    assert Bands(half[:, None], np.ones(1)).hold(np.array([18.0])).ravel().tolist() == [False, False, True]


def test_descriptors_do_not_change_with_the_view_and_tell_a_bar_from_posts(stack):
    (sample,) = read_samples(stack, [0])
    plain = descriptors(sample.depression, sample.tethers, sample.parameters)
    assert len(plain) == len(DESCRIPTORS)
    for element in Element.all():
        moved = transform_sample(sample, element)
        assert descriptors(moved.depression, moved.tethers, moved.parameters) == pytest.approx(plain)
    tethers = np.zeros_like(sample.tethers)
    tethers[4:28, 15] = 1
    barred = descriptors(sample.depression, tethers, sample.parameters)
    named = dict(zip(DESCRIPTORS, barred, strict=True))
    assert named["tethers"] == 1
    assert named["longest_tether"] > 24 * pixel_size(32)


def test_a_point_of_the_training_set_is_near_it_and_another_is_not():
    points = np.random.default_rng(0).normal(size=(500, 9)).astype(np.float32)
    training = TrainingSet(points, 2.0)
    assert training.distance(points[3].astype(np.float64)) == pytest.approx(0, abs=1e-6)
    assert training.distance(np.full(9, 6.0)) > 3


def test_what_is_unusual_is_named_with_its_value_and_the_range_that_was_trained_on():
    usual = dict.fromkeys(DESCRIPTORS, 0.5) | {"tethers": 2.0, "longest_tether": 10.0}
    points = np.array(list(usual.values())) + np.linspace(-0.4, 0.4, 41)[:, None]
    training = TrainingSet(points.astype(np.float32))
    point = np.array(list((usual | {"longest_tether": 24.0}).values()))
    assert training.unusual(point) == "longest tether 24 l0; trained on 9.6 to 10.4 l0"
    point = np.array(list((usual | {"tethers": 3.0}).values()))
    assert training.unusual(point) == "number of tethers 9; trained on 3 to 6"
    point = np.array(list((usual | {"delta": 0.85}).values()))
    told = training.unusual(point)
    assert re.fullmatch(r"Delta 0.815 with all else as it is; the nearest .* has 0\.\d+", told)


@dataclass(frozen=True)
class Image:
    """A mean in place of `Realisations`."""

    density: np.ndarray
    cast: CastMould

    def of_mean(self, threshold):
        return np.array([*shape_ratios(self.density, self.cast, threshold), 0, 0])


def test_the_threshold_of_softer_images_is_found():
    """Blurred tissues that fill less and less of a mould, at a threshold below half of their density."""
    mould = Mould(shapely.box(-20, -10, 20, 10))
    cast = CastMould(mould, 1, 128)
    x, y = np.meshgrid(pixel_centres(128), pixel_centres(128))
    cases = []
    for part in (0.5, 0.6, 0.7, 0.8):
        sharp = 1 / (1 + np.exp(4 * np.maximum(np.abs(x) - 20 * part, np.abs(y) - 10 * part)))
        soft = gaussian_filter(sharp, 3.0)
        true = np.array([*shape_ratios(sharp, cast, 0.3), 0, 0])
        cases.append(Case(true, Image(soft, cast)))
    factor = fit_threshold(cases, 0.3)
    assert factor > 1.02
    before, after = (np.mean([np.abs(c.error_of_mean(f * 0.3)[:2]) for c in cases]) for f in (1.0, factor))
    assert after < 0.5 * before
    same = [replace(c, simulated=c.found.of_mean(0.3)) for c in cases]
    assert fit_threshold(same, 0.3) == pytest.approx(1, abs=5e-3)


def test_local_alignment_does_not_depend_on_the_networks_raster():
    """Cells that point anywhere: block averages of 64 pixels mix their directions."""
    cast = CastMould(Mould(shapely.box(-20, -10, 20, 10)), 3, 256)
    turned = np.random.default_rng(5).uniform(0, np.pi, cast.n_cells)
    orientation = np.stack([np.cos(turned), np.sin(turned), np.zeros(cast.n_cells)], axis=1)
    fields = rasterise(cast.sites, orientation, np.zeros(cast.n_cells), 256).astype(np.float32)
    wanted, coarse = anisotropy(fields), block_average(fields, 64)
    assert anisotropy(coarse) < 0.95 * wanted
    ((_, found),) = Realisations.of(cast, coarse[None], sampled=False).directions
    assert found == pytest.approx(wanted, rel=0.02)


def test_an_ensemble_predicts_fields_with_bands_and_keeps_them_in_files(surrogate, moulds, stack, tmp_path):
    (sample,) = read_samples(stack, read_table(stack).rows("test")[:1])
    mould = moulds[sample.mould]
    prediction = surrogate.examine(mould, sample.parameters)
    assert prediction.values.shape == (8, 32, 32)
    assert prediction.field_bands.half.shape == (3, 8, 32, 32)
    assert prediction.measure_bands.half.shape == (3, 4)
    assert np.allclose(prediction.values, surrogate.predict(mould, [sample.parameters])[0], atol=1e-5)
    for half in (False, True):
        folder = tmp_path / f"{half}"
        save(folder, surrogate, {"training": {"threads": 1}}, "id", half=half)
        again = load(folder).examine(mould, sample.parameters)
        near = 5e-3 if half else 1e-6
        assert np.abs(again.values - prediction.values).max() < near * np.abs(prediction.values).max()
        assert again.measure_bands.half == pytest.approx(prediction.measure_bands.half, rel=0.05)
        assert again.distance == pytest.approx(prediction.distance)
        assert again.threshold == pytest.approx(prediction.threshold)
    assert prediction.threshold != pytest.approx(density_threshold(2, 32), rel=1e-3)
    with pytest.raises(RaptorError, match="not calibrated"):
        replace(surrogate, calibration=None).examine(mould, sample.parameters)


def test_evaluation_and_what_is_made_of_it(surrogate, moulds, stack):
    metrics = evaluate(predictor_of(surrogate), stack, moulds)
    assert len(metrics) == 2
    truth = evaluate(lambda sample, mould: sample.fields, stack, moulds)
    assert (truth[[f"vrmse_{field}" for field in FIELDS]] == 0).all(axis=None)
    assert (truth["tether_error"].dropna() == 0).all()
    assert (truth["area_ratio_predicted"] == truth["area_ratio_simulated"]).all()
    summary = summarise(metrics)
    assert summary["fields"]["density"]["vrmse"] == pytest.approx(metrics["vrmse_density"].mean())
    assert set(summary["coverage"]) == {
        f"cover{level}_{name}" for level in (50, 80, 95) for name in (*FIELDS, *MEASURED)
    }
    scores = summary["scores"]
    assert scores["crps_density"] == pytest.approx(metrics["crps_density"].mean())
    assert 0 <= scores["brier"] <= 1
    regions = by_region(metrics).set_index("region")
    assert regions.loc["all", "samples"] == 2
    below = int((metrics["delta"] < 0.3).sum())
    assert regions.loc["delta below 0.3", "samples"] == below
    costs = costs_of(surrogate, pd.DataFrame({"epoch": [0, 1], "seconds": [30.0, 30.0]}))
    assert costs["training_core_minutes"] == pytest.approx(1.0)
    assert costs["all_ms"] > 0
    assert costs.keys() - costs_of(surrogate, None).keys() == {"epochs", "training_core_minutes"}


def test_scores_tell_samples_of_the_truth_from_others():
    """Answers drawn as the truth is have the spread of their error, and its chance beats the base rate."""
    rng, rows = np.random.default_rng(0), []
    for chance in rng.random(200):
        answers, truth = rng.normal(size=(16, 50)), rng.normal(size=50)
        held = float(rng.random() < chance)
        rows.append({
            "crps_density": 0.0, "spread": answers.var(axis=0, ddof=1).mean() * (1 + 1 / 16),
            "skill": ((answers.mean(axis=0) - truth) ** 2).mean(), "brier": (chance - held) ** 2,
            "seen_held": held, "seen": 1.0, "vrmse_density": chance,
            # A distance within the limit says nothing.
            "distance": 0.9 * (1 - chance), "disagreement": chance**2,
        })  # fmt: skip
    found = summary_of(pd.DataFrame(rows))
    assert found["spread_over_skill"] == pytest.approx(1, abs=0.05)
    assert found["brier"] < found["brier_of_base_rate"]
    assert found["flag_auc"] == 1


def test_the_noise_floor_is_the_error_of_the_mean_of_many_runs(made, stack, moulds, tmp_path):
    base = read_design(made / "design.csv"), moulds
    again = build(tmp_path / "again", 4, design("again", repeat_of="paper", runs=5, seeds=2, **DRAWN), base)
    repeats = again / "fields.nc"
    floor = noise_floor(stack, repeats, moulds)
    assert floor["runs"].tolist() == [3, 3]
    # Another run scores sqrt 2 floors, in the mean over all pairs of runs.
    samples = list(read_samples(repeats, read_table(repeats).rows("test")))
    of_mould = {mould: [s.fields for s in samples if s.mould == mould] for mould in floor["mould"]}
    other = evaluate(lambda sample, mould: of_mould[sample.mould][0], stack, moulds)
    assert 0.7 < in_floors(other, floor)["density"] / np.sqrt(2) < 1.4
    perfect = evaluate(lambda sample, mould: sample.fields, stack, moulds)
    assert in_floors(perfect, floor)["density"] == 0


def test_a_floor_is_of_runs_of_the_same_tissue(made, stack, moulds, tmp_path):
    """A repeat whose own run failed, or had other parameters, has none."""
    base = read_design(made / "design.csv"), moulds
    given = design("again", repeat_of="paper", runs=2, seeds=1, **DRAWN)
    repeats = build(tmp_path / "again", 4, given, base)
    changed = tmp_path / "changed.nc"
    shutil.copy(repeats / "fields.nc", changed)
    with netCDF4.Dataset(changed, "a") as file:
        file["delta"][0] = 0.123
    floor = noise_floor(stack, changed, moulds)
    assert floor["mould"].tolist() == [read_table(changed).mould[1]]
    with netCDF4.Dataset(changed, "a") as file:
        file["delta"][:] = 0.123
    with pytest.raises(RaptorError, match="repeats no run of"):
        noise_floor(stack, changed, moulds)


def test_baselines(stack):
    examples = list_examples(stack)
    table = read_table(stack)
    nearest = Nearest.of(stack, examples)
    turn = Element(1, mirror=True)
    index = [Element.from_index(number) for number in range(8)].index(turn)
    for row in table.rows("train"):
        (sample,) = read_samples(stack, [row])
        assert np.array_equal(nearest.fields(sample), sample.fields)
        if Example(row, index) in examples:  # not where the mould's own symmetry makes it another's image
            turned = transform_sample(sample, turn)
            assert np.abs(nearest.fields(turned) - turned.fields).max() <= 1e-6
    mean = training_mean(stack, examples)
    chosen = [e for e in examples if table.split[e.sample] == "train"]
    plain = np.mean(
        [
            transform_sample(
                next(iter(read_samples(stack, [e.sample]))), Element.from_index(e.element)
            ).fields
            for e in chosen
        ],
        axis=0,
    )
    assert mean == pytest.approx(plain, abs=1e-5)
    with pytest.raises(RaptorError, match="no baseline 'median'"):
        baseline("median", stack, examples)


def test_active_learning_chooses_where_networks_disagree(surrogate):
    chosen = design("active", runs=2, selected_by="film_unet", **DRAWN | {"test": 0})
    told = []
    runs, moulds = chosen.make(score=disagreement_of(surrogate), on_progress=told.append)
    assert told == list(range(16))
    assert [run.simulation for run in runs] == [0, 1]
    assert [mould.name for mould in moulds] == [run.mould for run in runs]
    assert all(run.split == "train" for run in runs)
    scores = [float(run.own["disagreement"]) for run in runs]
    plain, drawn = design("active", runs=16, **DRAWN | {"test": 0}).make()
    score, by_name = disagreement_of(surrogate), {mould.name: mould for mould in drawn}
    every = sorted(score(by_name[run.mould], run.parameters) for run in plain)
    assert sorted(scores) == pytest.approx(every[-2:])


def test_examples_of_two_stacks_are_counted_through(stack, moulds):
    one, scaling = list_examples(stack), training_scaling(stack)
    table = read_table(stack)
    both, splits = join_examples([stack, stack], [one, one])
    assert splits == 2 * table.split
    assert len(both) == 2 * len(one)
    joined = ExampleSet([stack, stack], both, moulds, scaling)
    alone = ExampleSet(stack, [*one, *one], moulds, scaling)
    for number in range(len(both)):
        assert all(torch.equal(a, b) for a, b in zip(joined[number], alone[number], strict=True))


def test_what_a_model_learns_from_is_of_all_its_campaigns(stack, surrogate, moulds, tmp_path):
    """Scaling and descriptors of the training runs of both, calibration on the validation runs of both."""
    other = build(tmp_path / "other", 6, design("other"))
    second, again = other / "fields.nc", moulds_by_id(other / "moulds.geojson")
    alone, both = [training_scaling(s) for s in (stack, second)], training_scaling(stack, second)
    assert both.scale[0] == max(one.scale[0] for one in alone)
    told = []
    found = calibrate(surrogate, {stack: moulds, second: again}, 0, on_progress=told.append)
    assert len(told) == sum(len(read_table(each).rows("validation")) for each in (stack, second))
    assert len(found.training.points) == sum(len(read_table(s).rows("train")) for s in (stack, second))


def test_a_part_of_the_training_runs_is_in_every_larger_part(stack):
    parts = [training_rows(stack, fraction) for fraction in (0.3, 0.5, 1.0)]
    assert [len(part) for part in parts] == [1, 2, 3]
    assert all(set(small) <= set(large) for small, large in pairwise(parts))
    examples, _ = join_examples([stack], [list_examples(stack)], 0.3)
    assert {e.sample for e in examples} == {*parts[0], *read_table(stack).rows("validation")}
