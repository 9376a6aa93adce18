"""Studies of one's own moulds: one more campaign in a configuration, and nothing else."""

import shutil

import numpy as np
import pandas as pd
import pytest
import yaml

from raptor.config import load
from raptor.core.errors import RaptorError
from tests.small import ROOT
from tests.stand_ins import untrained
from tests.workflow.place import parsed

MOULDS = ROOT / "tests" / "data" / "moulds"
SMALL = {"name": "mine", "layers": 2, "accuracy": "draft", "pixels": 64, "models": {}}
GRID = {"delta": [0.2, 0.5, 0.8], "kappa_nnn": [0.5], "ratio": [0.6]}


def configured(folder, **campaigns):
    path = folder / "mine.yaml"
    path.write_text(yaml.safe_dump(SMALL | {"campaigns": campaigns}))
    return path


def test_a_mould_of_ones_own_gives_its_table_and_curves(workplace, tmp_path):
    """One mould beside the configuration, three values of delta, two seeds; no surrogate."""
    place = workplace("own")
    shutil.copy(MOULDS / "dog_bone.geojson", tmp_path / "bench.geojson")
    path = configured(tmp_path, bench={"moulds": "bench.geojson", "seeds": 2, "grid": GRID})
    figure = "results/mine/figures/contraction_bench.png"
    done = place.run("--cores", "2", figure, configuration=path)
    assert done.returncode == 0, done.stderr[-3000:]
    table = pd.read_csv(place.folder / "results" / "mine" / "studies" / "bench" / "simulated.csv")
    assert table["delta"].tolist() == [0.2, 0.2, 0.5, 0.5, 0.8, 0.8]
    assert table["seed"].nunique() == 6
    means = table.groupby("delta")[["area_ratio", "width_ratio"]].mean()
    assert means["area_ratio"].is_monotonic_decreasing
    assert (means["width_ratio"] < 1.1).all()
    assert (place.folder / figure).stat().st_size > 10_000
    curves = pd.read_csv(place.folder / "results" / "mine" / "figures" / "contraction_bench.csv")
    assert curves["seeds"].tolist() == [2] * 6


def test_a_trained_model_serves_sweeps_and_fits_of_ones_own(workplace, tmp_path):
    place = workplace("trained")
    untrained(tmp_path / "model")
    shutil.copy(MOULDS / "dog_bone.geojson", tmp_path / "bench.geojson")
    grid = {"delta": [0.2, 0.8], "kappa_nnn": [0.5], "ratio": [0.6]}
    settings = {
        "trained_model": "model", "layers": 4, "pixels": 32, "mould_scale": 1.0,
        "fit": {"tissues": ["glial_1"]}, "tradeoff": {"cases": {}},
        "campaigns": {"bench": {"moulds": "bench.geojson", "grid": grid}},
    }  # fmt: skip
    content = {name: value for name, value in SMALL.items() if name != "models"} | settings
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(content))
    wanted = ["results/mine/figures/contraction_bench.png", "results/mine/fits/glial_1.json"]
    done = place.run("--cores", "2", *wanted, configuration=path)
    assert done.returncode == 0, done.stderr[-3000:]
    curves = pd.read_csv(place.folder / "results" / "mine" / "figures" / "contraction_bench.csv")
    assert np.isfinite(curves[["simulated", "predicted"]]).all(axis=None)
    assert not {"train_member", "assemble_model", "evaluate_model"} & set(
        place.jobs("all", configuration=path)
    )
    drawn = {"runs": 6, "test": 2, "validation": 2}
    compared = {"models": {"small": {}}, "campaigns": content["campaigns"] | {"paper": drawn}}
    path.write_text(yaml.safe_dump(content | compared))
    by_it = ["results/mine/evaluation/trained/metrics.json", "results/mine/evaluation/samples.nc"]
    jobs = place.jobs(*by_it, configuration=path)
    assert {"evaluate_model", "predict_samples"} <= jobs and "train_member" not in jobs
    assert "train_member" in place.jobs("results/mine/evaluation/models.csv", configuration=path)
    path.write_text(yaml.safe_dump(content | {"layers": 3}))
    with pytest.raises(RaptorError, match="trained_model was made for 4; set layers: 4"):
        parsed(path)


def test_a_folder_of_moulds_is_simulated_at_a_sample_of_parameters(workplace, tmp_path):
    """GeoJSON, SVG and DXF, each at parameters of its own; table and figure by mould."""
    place, folder = workplace("folder"), tmp_path / "my_moulds"
    folder.mkdir()
    shutil.copy(MOULDS / "dog_bone.geojson", folder / "bone.geojson")
    shutil.copy(MOULDS / "dog_bone.svg", folder / "drawn.svg")
    shutil.copy(ROOT / "tests" / "data" / "doors" / "dxf" / "arcs.dxf", folder / "cad.dxf")
    (folder / "notes.txt").write_text("not a mould")
    path = configured(tmp_path, bench={"moulds": "my_moulds/", "runs": 6})
    wanted = ["results/mine/figures/outcomes_bench.png", "results/mine/campaigns/bench/checked.txt"]
    done = place.run("--cores", "2", *wanted, configuration=path)
    assert done.returncode == 0, done.stderr[-3000:]
    results = place.folder / "results" / "mine"
    table = pd.read_csv(results / "studies" / "bench" / "simulated.csv")
    assert table["mould"].value_counts().to_dict() == {"bone": 2, "cad": 2, "drawn": 2}
    assert table["delta"].nunique() == 6
    drawn = pd.read_csv(results / "figures" / "outcomes_bench.csv")
    assert set(drawn["group"]) == {"bone", "cad", "drawn"}
    assert drawn["simulations"].sum() == 6
    assert (results / "figures" / "outcomes_bench.png").stat().st_size > 10_000


def test_moulds_are_found_beside_the_configuration_then_here_then_in_the_library(tmp_path, monkeypatch):
    study, here = tmp_path / "study", tmp_path / "here"
    for folder in (study, here):
        folder.mkdir()
        shutil.copy(MOULDS / "dog_bone.geojson", folder / f"{folder.name}.geojson")
    monkeypatch.chdir(here)
    names = ["study.geojson", "here.geojson", "i_shape"]
    found = load(configured(study, bench={"moulds": names, "grid": GRID})).campaigns["bench"].files()
    assert list(found) == ["study", "here", "i_shape"]
    assert found["study"].resolve() == study / "study.geojson"
    assert found["here"].resolve() == here / "here.geojson"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({}, "holds no mould file"),
        ({"bad.svg": "<svg"}, "bad.svg"),
        ({"a.geojson": "", "a.svg": ""}, "same name"),
    ],
)
def test_a_folder_that_cannot_be_used_is_named_before_any_work(tmp_path, content, message):
    (tmp_path / "my_moulds").mkdir()
    for name, text in content.items():
        (tmp_path / "my_moulds" / name).write_text(text)
    with pytest.raises(RaptorError, match=message):
        parsed(configured(tmp_path, bench={"moulds": "my_moulds", "runs": 3}))
