"""Designs of campaigns of every kind."""

import json

import pytest
from pydantic import ValidationError

from raptor.core.errors import RaptorError
from raptor.dataset.campaign import Campaign, Grid
from raptor.dataset.design import read_design, write_design
from raptor.dataset.run import simulate_shard
from raptor.moulds import read_mould
from tests.small import MODEL, design

POINTS = {"delta": [0.2, 0.9], "kappa_nnn": [0.1, 0.7], "ratio": [0.1, 0.7]}
HELD_OUT = {"test": None, "validation": 0, "edge": 0}
SQUARE = {"type": "Polygon", "coordinates": [[[-6, -6], [6, -6], [6, 6], [-6, 6], [-6, -6]]]}


@pytest.fixture
def files(tmp_path):
    """Two mould files in a folder."""
    (tmp_path / "moulds").mkdir()
    for name in ("one", "two"):
        (tmp_path / "moulds" / f"{name}.geojson").write_text(json.dumps(SQUARE))
    return tmp_path / "moulds"


def test_a_grid_has_every_point_as_often_as_asked_with_seeds_of_its_own(files, tmp_path):
    given = design("sweep", moulds=str(files), grid=POINTS, seeds=2, **HELD_OUT)
    runs, moulds = given.make()
    assert [mould.name for mould in moulds] == ["one", "two"]
    assert len(runs) == given.campaign.simulations() == given.campaign.test_simulations() == 2 * 8 * 2
    assert [run.simulation for run in runs] == list(range(32))
    assert len({run.seed for run in runs}) == 32
    assert all(run.split == "test" for run in runs)
    points = [(run.mould, run.parameters) for run in runs]
    assert {points.count(point) for point in points} == {2}
    assert runs == given.make()[0]
    write_design(tmp_path / "design.csv", runs)
    assert read_design(tmp_path / "design.csv") == runs


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"delta": [0.97]}, "delta is 0.97"),
        ({"kappa_nnn": [0.05]}, "kappa_nnn is 0.05"),
        ({"kappa_nnn": [0.1], "ratio": [0.05]}, "kappa_nnnn is 0.005"),
        ({"ratio": [0.8]}, "above kappa_nnn/sqrt"),
        ({"delta": [0.5, 0.2]}, "ascending values are needed"),
    ],
)
def test_points_outside_of_what_is_learnt_are_refused(values, message):
    with pytest.raises((ValidationError, RaptorError), match=message):
        Grid.model_validate({"delta": [0.5], "kappa_nnn": [0.5], "ratio": [0.5]} | values)


def test_moulds_that_are_given_take_turns_at_parameters_that_are_drawn(files):
    runs, _ = design(
        "mine",
        moulds=[str(files / "one.geojson"), str(files)[:-6] + "moulds/two.geojson"],
        runs=5,
        **HELD_OUT,
    ).make()
    assert [run.mould for run in runs] == ["one", "two", "one", "two", "one"]
    assert len({run.parameters for run in runs}) == 5


def test_standard_moulds_are_scaled_and_the_users_own_are_not(files):
    given = design("mine", moulds=["i_shape", str(files / "one.geojson")], grid=POINTS, **HELD_OUT)
    _, (standard, own) = given.model_copy(update={"mould_scale": 0.7}).make()
    assert standard.outline.area == pytest.approx(0.49 * read_mould("i_shape").outline.area)
    assert own.outline.area == pytest.approx(144)


@pytest.mark.parametrize("moulds", ["long_bars", "slender_strips"])
def test_moulds_unlike_the_random_ones_are_held_out_and_castable(moulds):
    given = design("unlike", moulds=moulds, runs=3, **HELD_OUT)
    given = given.model_copy(update={"drawn_from": given.drawn_from.model_copy(update={"cells": (400, 900)})})
    runs, drawn = given.make()
    assert all(run.split == "test" for run in runs)
    assert all(mould.tethers for mould in drawn)
    simulations, failures = simulate_shard(runs[:1], {mould.name: mould for mould in drawn}, MODEL, "draft")
    assert not failures
    assert len(simulations) == 1


def test_repeats_are_the_test_runs_with_other_seeds():
    runs, moulds = design().make()
    by_name = {mould.name: mould for mould in moulds}
    again, theirs = design("again", repeat_of="paper", runs=1, seeds=3, **HELD_OUT).make((runs, by_name))
    (number,) = {run.own["repeat_of"] for run in again}
    first = runs[int(number)]
    assert first.split == "test"
    assert {(run.mould, run.parameters) for run in again} == {(first.mould, first.parameters)}
    assert [mould.name for mould in theirs] == [first.mould]
    assert len({run.seed for run in again} | {first.seed}) == 4
    assert Campaign(repeat_of="paper", runs=9, seeds=3).simulations(repeated=2) == 6


def test_what_is_drawn_with_one_mould_has_one_split():
    runs, _ = design(seeds=3).make()
    assert len(runs) == 18
    splits = {(run.mould, run.split) for run in runs}
    assert len(splits) == 6
    assert [sum(split == name for _, split in splits) for name in ("test", "validation")] == [2, 1]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"runs": 3, "test": 2, "validation": 2}, "are more than the 3 runs"),
        ({"runs": 3, "edge": 4}, "edge .4. is more than runs"),
        ({"delta": [0.0, 0.95]}, "delta is .0.0, 0.95."),
        ({"kappa_nnn": [0.1, 0.2], "kappa_nnnn": [0.4, 0.5]}, "above kappa_nnn/sqrt"),
        ({"moulds": "i_shape", "test": 3}, "are for random moulds"),
        ({"repeat_of": "paper", "test": 3}, "are for random moulds"),
        ({"selected_by": "film_unet", "test": 0, "edge": 2}, "edge is for runs drawn at random"),
    ],
)
def test_keys_that_do_not_go_together_are_named(keys, message):
    with pytest.raises(ValidationError, match=message):
        Campaign.model_validate(keys)


def test_moulds_that_are_not_there_are_named(tmp_path, files):
    with pytest.raises(RaptorError, match="did you mean 'i_shape'"):
        Campaign(moulds="ishape").files()
    (tmp_path / "empty").mkdir()
    with pytest.raises(RaptorError, match="holds no mould file"):
        Campaign(moulds=str(tmp_path / "empty")).files()
    (tmp_path / "one.geojson").write_text(json.dumps(SQUARE))
    with pytest.raises(RaptorError, match="same name; rename one"):
        Campaign(moulds=(str(files), str(tmp_path / "one.geojson"))).files()
