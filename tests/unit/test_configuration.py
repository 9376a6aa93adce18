import json

import jsonschema
import pytest
import yaml
from pydantic import ValidationError

from raptor.config import Configuration, load, require_measurable
from raptor.config.reference import key_table, write_reference
from raptor.core.errors import RaptorError
from raptor.moulds.library.tissues import MeasuredTissue, load_tissues, require_measured


@pytest.fixture
def root(pytestconfig):
    return pytestconfig.rootpath


def test_schema_defaults_and_key_table_are_those_of_the_model(root, tmp_path):
    (tmp_path / "config").mkdir()
    (tmp_path / "workflow").mkdir()
    for written in write_reference(tmp_path):
        committed = root / written.relative_to(tmp_path)
        assert committed.read_text() == written.read_text(), f"run: raptor reference ({committed})"


def test_the_default_configuration_states_every_default(root):
    assert load(root / "config" / "laptop.yaml") == Configuration()


@pytest.mark.parametrize("name", ["laptop", "paper"])
def test_configurations_fit_schema_and_model(root, name):
    path = root / "config" / f"{name}.yaml"
    schema = json.loads((root / "workflow" / "schemas" / "config.schema.json").read_text())
    jsonschema.validate(yaml.safe_load(path.read_text()), schema)
    assert load(path).name == name


def test_the_paper_is_configured_as_it_states(root):
    paper = load(root / "config" / "paper.yaml")
    assert (paper.design.simulations, paper.design.test, paper.design.edge) == (3569, 445, 500)
    assert (paper.model.layers, paper.fields.pixels) == (7, 256)


def test_every_key_is_explained():
    assert "| None |" not in key_table()


def test_shards_cover_every_simulation_once():
    config = Configuration.model_validate({"simulation": {"shard_size": 5}})
    numbers = [range(*(int(n) for n in shard.split("-"))) for shard in config.shards]
    assert [n for r in numbers for n in (*r, r.stop)] == list(range(64))


def test_a_fingerprint_changes_with_what_it_depends_on_alone():
    plain = Configuration()
    cores = Configuration.model_validate({"simulation": {"shard_size": 9}, "fit": {"starts": 16}})
    pixels = Configuration.model_validate({"fields": {"pixels": 64}})
    for stage in ("design", "simulation", "dataset"):
        assert plain.fingerprint(stage) == cores.fingerprint(stage)
    for further in plain.further_sets:
        assert plain.further_fingerprint(further) == cores.further_fingerprint(further)
    more = Configuration.model_validate({"surrogate": {"ensemble_size": 5}})
    longer = Configuration.model_validate({"surrogate": {"epochs": 5}})
    for model in ("film_unet", "pix2pix"):
        assert plain.model_fingerprint(model) == more.model_fingerprint(model)
        assert plain.model_fingerprint(model) != longer.model_fingerprint(model)
    assert plain.fingerprint("simulation") == pixels.fingerprint("simulation")
    assert plain.fingerprint("dataset") != pixels.fingerprint("dataset")


def test_a_compared_model_is_the_surrogate_but_for_its_keys():
    compared = {"other": {"network": "fno", "epochs": 3}}
    config = Configuration.model_validate(
        {"surrogate": {"ensemble_size": 4, "batch_size": 7}, "compared": compared}
    )
    assert list(config.models) == ["film_unet", "other"]
    other = config.models["other"]
    assert (other.network, other.epochs, other.batch_size, other.ensemble_size) == ("fno", 3, 7, 1)
    for changes, message in (
        ({"film_unet": {}}, "has the name of surrogate.model"),
        ({"other": {"epoch": 3}}, "has the key 'epoch'"),
        ({"other": {"epochs": 0}}, "greater than or equal to 1"),
        ({"other": {"pixels": 100}}, "Input should be 16, 32, 64, 128"),
    ):
        with pytest.raises(ValidationError, match=message):
            Configuration.model_validate({"compared": changes})


def test_a_model_continues_one_that_is_listed_before_it_and_like_it():
    config = Configuration.model_validate(
        {
            "compared": {"on": {"initial_weights": "film_unet"}, "further": {"initial_weights": "on"}},
            "chosen": "on",
        }
    )
    assert (config.surrogate.model, config.chosen_model) == ("film_unet", "on")
    longer = config.model_copy(update={"surrogate": config.surrogate.model_copy(update={"epochs": 9})})
    changed = Configuration.model_validate(longer.model_dump())
    assert all(config.model_fingerprint(n) != changed.model_fingerprint(n) for n in config.models)
    for compared, message in (
        ({"on": {"initial_weights": "off"}}, "no model listed before it; allowed are film_unet"),
        (
            {"on": {"initial_weights": "later"}, "later": {}},
            "no model listed before it; allowed are film_unet",
        ),
        ({"on": {"initial_weights": "film_unet", "base_channels": 3}}, "on.base_channels differs from"),
        ({"on": {"initial_weights": "film_unet", "ensemble_size": 3}}, "on.ensemble_size is 3; film_unet"),
        ({"on": {"initial_weights": "film_unet", "adversarial": 1.0}}, "adversarial: 0"),
    ):
        with pytest.raises(ValidationError, match=message):
            Configuration.model_validate({"compared": compared})
    with pytest.raises(ValidationError, match="chosen is 'none'; allowed are film_unet, pix2pix"):
        Configuration.model_validate({"chosen": "none"})


def test_all_tissues_can_be_fitted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tissues = load_tissues()
    require_measurable(tissues, 1.0)
    assert {"glial_1", "glial_2", "glial_3", "fibroblast", "corneal"} <= set(tissues)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("- a", "holds no keys"), ("a: [", "is not YAML"),
        ("design: {tset: 3}", "unknown key 'design.tset'; did you mean 'test'"),
        ("model: {shells: [2, 3, 4]}", "shells is"),
        ("moulds: {symmetry: {none: 0}}", "positive weight"),
        ("moulds: {cells: [9, 3]}", "ascending"),
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
    tenocyte = load_tissues(names=("tenocyte",))
    assert not tenocyte["tenocyte"].measured
    require_measured({}, tenocyte)
    with pytest.raises(RaptorError, match=r"name it in fit\.unmeasured"):
        require_measured(tenocyte, {})
    measured = MeasuredTissue.model_validate({"description": "x", "mould": "y", "area_ratio": 0.5})
    with pytest.raises(RaptorError, match="has no paper"):
        require_measured({}, {"x": measured})


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


def test_a_gpu_contracts_at_draft_and_standard_only():
    with pytest.raises(ValidationError, match="accuracy: reference choose device: auto or cpu"):
        Configuration.model_validate({"device": "cuda", "simulation": {"accuracy": "reference"}})
