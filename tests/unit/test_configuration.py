import json
import shutil

import jsonschema
import pytest
import yaml
from pydantic import ValidationError

from raptor.config import Configuration, load, parse
from raptor.config.reading import require_castable, require_measurable
from raptor.config.reference import key_table, write_reference
from raptor.core.errors import RaptorError
from raptor.moulds.library import MOULDS
from raptor.moulds.library.tissues import MeasuredTissue, load_tissues
from raptor.parameters import CellParameters

pytestmark = pytest.mark.one_processor

MIDDLE = {"delta": 0.5, "kappa_nnn": 0.5, "kappa_nnnn": 0.3}


@pytest.fixture
def root(pytestconfig):
    return pytestconfig.rootpath


def test_schema_defaults_and_key_table_are_those_of_the_model(root, tmp_path):
    (tmp_path / "config").mkdir()
    (tmp_path / "workflow").mkdir()
    for written in write_reference(tmp_path):
        committed = root / written.relative_to(tmp_path)
        assert committed.read_text() == written.read_text(), f"run: raptor reference ({committed})"


def test_the_default_run_states_every_default_but_its_surrogate(root):
    stated = load(root / "config" / "laptop.yaml")
    assert stated == Configuration().model_copy(update={"trained_model": "shipped"})


@pytest.mark.parametrize("name", ["laptop", "paper", "tradeoff"])
def test_configurations_fit_schema_and_model(root, name):
    path = root / "config" / f"{name}.yaml"
    schema = json.loads((root / "workflow" / "schemas" / "config.schema.json").read_text())
    jsonschema.validate(yaml.safe_load(path.read_text()), schema)
    configuration = load(path)
    assert configuration.name == name
    assert Configuration.model_validate(configuration.model_dump(mode="json")) == configuration


@pytest.mark.parametrize(
    ("name", "added"),
    [
        ("full", "comparison"),
        ("full", "learning_curve"),
        ("paper", "active_learning"),
        ("paper", "published"),
    ],
)
def test_configurations_to_be_added_fit_those_that_they_name(root, name, added):
    first, second = (yaml.safe_load((root / "config" / f"{n}.yaml").read_text()) for n in (name, added))
    for block in ("campaigns", "models"):  # as Snakemake merges two files
        first[block] |= second.pop(block, {})
    configuration = Configuration.model_validate(first | second)
    assert set(configuration.models) > {"film_unet"}


def test_the_paper_is_configured_as_it_states(root):
    paper = load(root / "config" / "paper.yaml")
    campaign = paper.campaigns["paper"]
    assert (campaign.runs, campaign.test, campaign.edge) == (3569, 445, 500)
    assert (paper.layers, paper.pixels, paper.surrogate) == (7, 256, "film_unet")


@pytest.mark.parametrize("name", ["laptop", "paper"])
def test_the_hardest_corner_is_swept(root, name):
    sweep = load(root / "config" / f"{name}.yaml").campaigns["sweep"]
    assert CellParameters(0.9, 0.1, 0.01) in sweep.grid.points
    assert list(sweep.files()) == ["four_post_rectangle", "i_shape"]


def test_every_key_is_explained():
    assert "| None |" not in key_table()


def test_shards_cover_every_simulation_once():
    config = Configuration.model_validate({"shard_size": 5})
    for campaign in config.campaigns:
        numbers = [range(*(int(n) for n in shard.split("-"))) for shard in config.shards(campaign)]
        assert [n for r in numbers for n in (*r, r.stop)] == list(range(config.simulations(campaign)))


STAGES = ("design", "simulation", "fields")


def fingerprints(content=None):
    """Of every campaign and stage, and of every model."""
    config = Configuration.model_validate(content or {})
    found = {(c, stage): config.fingerprint(stage, c) for c in config.campaigns for stage in STAGES}
    return found | {name: config.model_fingerprint(name) for name in config.models}


def changed(content):
    """What another configuration than the default makes again."""
    plain, other = fingerprints(), fingerprints(content)
    return {key for key in plain if plain[key] != other.get(key)}


def test_a_fingerprint_changes_with_what_it_depends_on_alone():
    plain, models = Configuration(), {"film_unet", "pix2pix"}
    every = {(campaign, stage) for campaign in plain.campaigns for stage in STAGES}
    assert len(set(fingerprints().values())) == len(every | models)
    assert not changed({"shard_size": 9, "check_fraction": 0.5, "fit": {"simulations": 0}})
    assert changed({"pixels": 64}) == {key for key in every if key[1] == "fields"} | models
    assert changed({"accuracy": "draft"}) == {key for key in every if key[1] != "design"} | models
    assert changed({"mould_scale": 0.6}) == {("sweep", stage) for stage in STAGES}
    drawn = changed({"random_moulds": {"cells": [600, 3000]}})
    assert drawn == {key for key in every if key[0] != "sweep"} | models
    stated = plain.model_dump(mode="json")
    stated["campaigns"]["mine"] = {"moulds": "glial_1", "runs": 3}
    assert not changed(stated)
    stated["campaigns"]["paper"]["runs"] = 65
    assert changed(stated) == {key for key in every if key[0] in ("paper", "replicates")} | models


def test_a_model_depends_on_its_keys_its_campaigns_and_where_it_starts():
    given = {"film_unet": {"epochs": 5}, "on": {"initial_weights": "film_unet", "epochs": 2}, "other": {}}
    plain = fingerprints({"models": given})

    def differing(**change):
        other = fingerprints({"models": given | change})
        return {name for name in given if plain[name] != other[name]}

    assert differing(film_unet={"epochs": 5, "ensemble_size": 3}) == set()
    assert differing(film_unet={"epochs": 6}) == {"film_unet", "on", "other"}
    assert differing(on={"initial_weights": "film_unet", "epochs": 3}) == {"on"}


def test_a_model_is_as_the_first_but_for_its_keys():
    models = {"film_unet": {"ensemble_size": 4, "batch_size": 7}, "other": {"network": "fno", "epochs": 3}}
    other = Configuration.model_validate({"models": models}).models["other"]
    assert (other.network, other.epochs, other.batch_size, other.ensemble_size) == ("fno", 3, 7, 4)


@pytest.mark.parametrize(
    ("models", "message"),
    [
        ({"one": {"epoch": 3}}, "epoch"),
        ({"one": {}, "two": {"epochs": 0}}, "greater than or equal to 1"),
        ({"one": {}, "on": {"initial_weights": "off"}}, "initial_weights is 'off'; allowed are one, on"),
        ({"one": {"initial_weights": "one"}}, "each of these depends on the next"),
        ({"one": {}, "on": {"initial_weights": "one", "base_channels": 3}}, "on.base_channels differs"),
        ({"one": {}, "on": {"initial_weights": "one", "ensemble_size": 3}}, "on.ensemble_size is 3"),
        ({"one": {"campaigns": ["sweep"]}}, "sweep has no run to train on"),
        ({"one": {"campaigns": ["papers"]}}, "campaigns has 'papers'; allowed are paper"),
        ({"one": {"noise": 8}, "on": {"initial_weights": "one", "noise": 16}}, "its initial_weights has 8"),
        ({"one": {}, "nearest": {}}, "nearest and mean are baselines; choose another name"),
        ({"one": {"lambda_l1": 100.0}, "on": {"initial_weights": "one"}}, "set lambda_l1: null"),
    ],
)
def test_models_that_cannot_be_trained_are_named(models, message):
    with pytest.raises(ValidationError, match=message):
        Configuration.model_validate({"models": models})


@pytest.mark.parametrize(
    ("campaign", "message"),
    [
        ({"repeat_of": "none"}, "repeat_of is 'none'; allowed are paper"),
        ({"repeat_of": "replicates"}, "repeat_of is 'replicates'; allowed are paper"),
        ({"selected_by": "none", "test": 0}, "selected_by is 'none'; allowed are film_unet, pix2pix"),
    ],
)
def test_campaigns_that_cannot_be_made_are_named(campaign, message):
    campaigns = Configuration().model_dump(mode="json")["campaigns"] | {"mine": campaign}
    with pytest.raises(ValidationError, match=message):
        Configuration.model_validate({"campaigns": campaigns})


def test_a_model_does_not_select_what_it_learns_from():
    campaigns = {
        "paper": {"test": 4, "validation": 4, "runs": 16},
        "active": {"selected_by": "film_unet", "test": 0},
    }
    models = {"film_unet": {"campaigns": ["paper", "active"]}}
    with pytest.raises(ValidationError, match="each of these depends on the next"):
        Configuration.model_validate({"campaigns": campaigns, "models": models})
    models = {"film_unet": {}, "active": {"campaigns": ["paper", "active"], "initial_weights": "film_unet"}}
    config = Configuration.model_validate({"campaigns": campaigns, "models": models})
    assert (config.surrogate, config.main_campaign) == ("film_unet", "paper")


def test_without_models_campaigns_are_only_simulated():
    config = Configuration.model_validate({"campaigns": {"mine": {"moulds": "i_shape"}}, "models": {}})
    assert config.surrogate is None
    assert config.main_campaign is None
    assert not config.trial("soft")["surrogate"]
    with pytest.raises(ValidationError, match="to simulate only"):
        Configuration.model_validate({"campaigns": {"mine": {"moulds": "i_shape"}}})
    with pytest.raises(ValidationError, match="selected_model is 'none'; allowed are film_unet, pix2pix"):
        Configuration.model_validate({"selected_model": "none"})


def test_a_trained_model_is_the_surrogate_beside_models_trained_here():
    shipped = {"trained_model": "shipped"}
    alone = Configuration.model_validate(shipped | {"campaigns": {"mine": {"moulds": "i_shape"}}})
    assert (alone.models, alone.own_model, alone.surrogate) == ({}, None, "shipped")
    beside = Configuration.model_validate(shipped | {"models": {"film_unet": {}}})
    assert (beside.own_model, beside.surrogate) == ("film_unet", "shipped")
    assert beside.surrogate_fingerprint != beside.model_fingerprint("film_unet")
    elsewhere = beside.model_copy(update={"trained_model": "results/a/surrogate/film_unet"})
    assert (elsewhere.surrogate, elsewhere.trained_folder.name) == ("trained", "film_unet")
    for wrong in ({"models": {"shipped": {}}}, {"models": {"a": {}}, "selected_model": "a"}):
        with pytest.raises(ValidationError, match="trained_model"):
            Configuration.model_validate(shipped | wrong)


def test_all_tissues_can_be_fitted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tissues = load_tissues()
    require_measurable({n: t for n, t in tissues.items() if t.measured}, 1.0)
    assert {"glial_1", "glial_2", "glial_3", "fibroblast", "corneal"} <= set(tissues)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("- a", "holds no keys"), ("a: [", "is not YAML"),
        ("fit: {tisues: [x]}", "unknown key 'fit.tisues'; did you mean 'tissues'"),
        ("campaigns: {paper: {tset: 3}}", "unknown key 'campaigns.paper.tset'; did you mean 'test'"),
        ("shells: [2, 3, 4]", "shells is"),
        ("random_moulds: {cells: [9, 3]}", "ascending"),
        ("name: Bad Name", "name: String should match"),
        ("seed: .nan", "seed"),
    ],
)  # fmt: skip
def test_a_bad_configuration_is_named(tmp_path, text, message):
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(RaptorError, match=message) as caught:
        load(path)
    assert "bad.yaml" in str(caught.value)


def test_a_tissue_needs_a_measurement():
    with pytest.raises(ValueError, match="neither area_ratio nor width_ratio"):
        MeasuredTissue.model_validate({"description": "x", "mould": "y"})


def test_a_tissue_without_ratios_is_simulated_and_not_fitted():
    with pytest.raises(
        RaptorError, match=r"cannot be fitted; simulate it as a campaign, with moulds: .tenocyte"
    ):
        require_measurable(load_tissues(names=("tenocyte",)), 1.0)


@pytest.mark.parametrize(
    ("fit", "message"),
    [
        ({"joint": ["glial_2", "glial_1"]}, "joint has 'glial_2', which is not in tissues"),
        ({"joint": ["glial_1"]}, "two tissues or more"),
    ],
)
def test_a_joint_fit_needs_tissues_that_are_fitted(fit, message):
    with pytest.raises(ValidationError, match=message):
        Configuration.model_validate({"fit": fit})


def test_a_gpu_is_not_made_up(monkeypatch):
    """Here, whatever the machine has: nvidia-smi and torch are told to see none, or one."""
    import torch

    from raptor.core.device import chosen_device

    monkeypatch.setattr("shutil.which", lambda name: f"/usr/bin/{name}")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert chosen_device("cpu") == chosen_device("auto") == "cpu"
    with pytest.raises(RaptorError, match=r"sees no GPU; choose device: auto or cpu"):
        chosen_device("cuda")
    with pytest.raises(RaptorError, match="allowed are auto, cpu, cuda"):
        chosen_device("gpu")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    assert chosen_device("cuda") == chosen_device("auto") == "cuda"
    assert chosen_device("auto", gpus=0) == "cpu"  # a job that was given none
    monkeypatch.setattr("shutil.which", lambda name: None)
    assert chosen_device("auto") == "cpu"


def test_paths_are_found_beside_the_configuration_then_here_then_in_the_library(tmp_path, monkeypatch):
    study, desk = tmp_path / "my stüdy", tmp_path / "desk"
    study.mkdir()
    desk.mkdir()
    for folder, name in ((study, "mine"), (desk, "here"), (study, "both"), (desk, "both")):
        shutil.copy(MOULDS["small_rectangle"], folder / f"{name}.geojson")
    (study / "tissues.yaml").write_text("{mine: {description: x, mould: mine.geojson, area_ratio: 0.8}}")
    content = {
        "name": "study",
        "campaigns": {"a": {"moulds": ["mine.geojson", "here.geojson", "both.geojson", "glial_1"]}},
        "models": {},
        "tradeoff": {"cases": {"one": {"mould": "mine.geojson", **MIDDLE}}},
        "fit": {"tissues_file": "tissues.yaml", "tissues": ["mine"]},
    }
    (study / "study.yaml").write_text(yaml.safe_dump(content))
    monkeypatch.chdir(desk)
    found = load(study / "study.yaml")
    mine = str(study / "mine.geojson")
    assert found.campaigns["a"].moulds == (mine, "here.geojson", str(study / "both.geojson"), "glial_1")
    assert found.tradeoff.cases["one"].mould == mine
    assert load_tissues(found.fit.tissues_file)["mine"].mould == mine
    require_castable(found)
    # Where the two folders are one, a path stays as it is written, and so does the campaign's fingerprint.
    monkeypatch.chdir(study)
    beside = load(study / "study.yaml")
    assert beside.campaigns["a"].moulds[0] == "mine.geojson"
    assert beside.fingerprint("design", "a") == parse(content, "here").fingerprint("design", "a")
    monkeypatch.chdir(tmp_path)
    assert load(study / "study.yaml").campaigns["a"].moulds[0] == "my stüdy/mine.geojson"
