"""The study of training data: models that differ in campaigns and in the share of their runs."""

import json

import pandas as pd
import pytest
import yaml

from raptor.dataset.check import check

SMALL = {
    "name": "learning", "layers": 2, "accuracy": "draft", "pixels": 32, "shard_size": 5, "mould_scale": 0.55,
    "random_moulds": {"cells": [100, 300], "tethers": [0, 3]},
    "mould_families": {"cells": [300, 900]},
    "campaigns": {
        "paper": {"runs": 8, "test": 2, "validation": 2},
        "families": {"moulds": "families", "runs": 9, "test": 3, "validation": 2},
        "again": {"repeat_of": "families", "runs": 1, "seeds": 2},
    },
    "models": {
        "both": {"campaigns": ["paper", "families"], "base_channels": 4, "epochs": 1, "pixels": 16,
                 "ensemble_size": 1},
        "half_alone": {"campaigns": ["families"], "training_fraction": 0.5},
    },
}  # fmt: skip
RUNS = {
    "both": {"paper": 4, "families": 4},
    "half_alone": {"families": 2},
}


@pytest.fixture(scope="module")
def results(workplace, tmp_path_factory):
    place = workplace("learning")
    path = tmp_path_factory.mktemp("configuration") / "learning.yaml"
    path.write_text(yaml.safe_dump(SMALL))
    done = place.run(
        "--cores", "2", "results/learning/figures/learning.png", "publish",
        configuration=path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    return place.folder / "results" / "learning"


def test_every_model_is_tested_on_each_campaign_by_itself(results):
    table = pd.read_csv(results / "evaluation" / "models_by_campaign.csv").set_index(["model", "tested_on"])
    assert set(table.index) == {(model, campaign) for model in RUNS for campaign in ("paper", "families")}
    assert (table.xs("paper", level=1)["samples"] == 2).all()
    assert (table.xs("families", level=1)["samples"] == 3).all()
    assert table["training_runs"].groupby("model").first().to_dict() == {
        name: sum(runs.values()) for name, runs in RUNS.items()
    }
    assert table.xs("families", level=1)["floor"].notna().all()
    assert table.xs("paper", level=1)["floor"].isna().all()  # no repeats
    assert (results / "figures" / "learning.png").stat().st_size > 10_000
    regions = pd.read_csv(results / "evaluation" / "both" / "regions.csv")["region"].tolist()
    assert {"all", "families: all", "families: delta below 0.3"} <= set(regions)


@pytest.mark.parametrize("model", RUNS)
def test_a_model_is_scaled_by_the_runs_that_it_is_trained_on(results, model):
    scaling = json.loads((results / "surrogate" / model / "normalisation.json").read_text())
    described = json.loads((results / "surrogate" / model / "model.json").read_text())
    assert described["training"]["runs"] == RUNS[model]
    assert scaling["campaigns"] == list(RUNS[model])
    assert described["normalisation"]["scale"] == scaling["scale"]


def test_the_card_tells_both_test_splits(results):
    card = (results / "shipped" / "card.md").read_text()
    assert "2 simulations of `paper` and 3 simulations of `families`" in card
    assert "### Campaign `paper`" in card
    assert "### Campaign `families`" in card


def test_the_published_folder_is_sound_and_takes_no_room_twice(results):
    published = results / "publish"
    assert check(published, 0.1) == []
    for path in (results / "campaigns").rglob("*.*"):
        if path.name != "splits_checked.txt":
            assert path.samefile(published / path.relative_to(results))
    card = (published / "surrogate" / "README.md").read_text()
    header = yaml.safe_load(card.split("---\n")[1])
    assert header["license"] == "cc-by-4.0"
    assert [result["dataset"]["name"] for result in header["model-index"][0]["results"]] == [
        "paper, test split", "families, test split",
    ]  # fmt: skip
    made = {path.name for path in (published / "surrogate").iterdir()}
    assert made == {"README.md", "weights.safetensors", "model.json", "training.csv"}


def test_the_check_covers_every_model(results):
    def faults():
        return [fault for fault in check(results) if "normalisation" in fault]

    assert faults() == []
    path = results / "surrogate" / "half_alone" / "normalisation.json"
    text = path.read_text()
    path.write_text(json.dumps(json.loads(text) | {"training_fraction": 1.0, "offset": [0.0] * 8}))
    assert any("half_alone/normalisation.json: the constants do not agree" in fault for fault in faults())
    path.write_text(text)
