"""A study of one's own: one more campaign in a configuration, and nothing else."""

import json

import pandas as pd
import yaml

from tests.small import ROOT

DOG_BONE = ROOT / "tests" / "data" / "moulds" / "dog_bone.geojson"


def test_a_mould_of_ones_own_gives_its_table_and_curves(workplace, tmp_path):
    """One mould, three values of delta, two seeds; no surrogate."""
    place = workplace("own")
    mould = json.loads(DOG_BONE.read_text())
    (place.folder / "bench.geojson").write_text(json.dumps(mould))
    content = {
        "name": "mine", "layers": 2, "accuracy": "draft", "pixels": 64,
        "campaigns": {
            "bench": {
                "moulds": "bench.geojson", "seeds": 2,
                "grid": {"delta": [0.2, 0.5, 0.8], "kappa_nnn": [0.5], "ratio": [0.6]},
            }
        },
        "models": {},
    }  # fmt: skip
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(content))
    figure = "results/mine/figures/contraction_bench.png"
    done = place.run("--cores", "2", figure, configuration=tmp_path / "mine.yaml")
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
