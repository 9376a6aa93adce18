"""Bad input stops before any job starts, with one clear sentence and a non-zero status."""

import pytest
import yaml

from tests.workflow.test_end_to_end import variant

CASE = {
    "name": "one", "mould": "small_rectangle",
    "delta": 0.5, "kappa_nnn": 0.5, "kappa_nnnn": 0.3,
}  # fmt: skip


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"desing": {}}, "unknown key 'desing'; did you mean 'design'?"),
        (
            {"design__simulatoins": 3},
            "unknown key 'design.simulatoins'; did you mean 'simulations'?",
        ),
        ({"design__test": 8}, "leave none of the 8 simulations for training"),
        ({"design__delta": [0.0, 0.95]}, "delta is [0.0, 0.95]"),
        ({"design__kappa_nnnn": [0.6, 0.7]}, "within [0.01, 0.5]"),
        ({"fields__pixels": 100}, "fields.pixels"),
        ({"moulds__cells": [100, 400000]}, "more than 2 layers hold"),
        ({"tradeoff__methods": ["perfect"]}, "accuracy is 'perfect'; allowed are draft"),
        ({"tradeoff__pixels": [24]}, "no whole part or multiple of fields.pixels"),
        ({"tradeoff__folding_case": "two"}, "folding_case is 'two'; cases are one"),
        ({"tradeoff__cases": [CASE | {"dleta": 0.5}]}, "'tradeoff.cases.0.dleta'; did you mean 'delta'?"),
        ({"tradeoff__cases": [CASE | {"mould": "none.geojson"}]}, "none.geojson"),
        ({"sweep__ratios": [0.8]}, "above kappa_nnn/sqrt(2)"),
        ({"sweep__panels": [0.55]}, "panels has 0.55, which deltas does not have"),
        ({"sweep__moulds": ["none.geojson"]}, "none.geojson"),
        ({"fit__tissues": ["glial"], "fit__joint": []}, "has no tissue 'glial'; did you mean 'glial_"),
        ({"fit__tissues_file": "none.yaml"}, "none.yaml cannot be read"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_a_bad_configuration(workplace, tmp_path, change, message):
    place = workplace("bad")
    done = place.run("--cores", "1", configuration=variant(tmp_path, **change))
    assert done.returncode != 0
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not (place.folder / "results").exists()


def test_a_bad_mould_of_a_tissue(workplace, tmp_path):
    (tmp_path / "cross.geojson").write_text(
        '{"type": "Polygon", "coordinates": [[[0, 0], [5, 5], [5, 0], [0, 5], [0, 0]]]}'
    )
    tissue = {"description": "x", "mould": str(tmp_path / "cross.geojson"), "area_ratio": 0.8}
    (tmp_path / "tissues.yaml").write_text(yaml.safe_dump({"mine": tissue}))
    change = {"fit__tissues": ["mine"], "fit__tissues_file": str(tmp_path / "tissues.yaml")}
    change |= {"fit__joint": [], "fit__unmeasured": []}
    done = workplace("cross").run("--cores", "1", configuration=variant(tmp_path, **change))
    assert done.returncode != 0
    assert "not a simple polygon" in done.stderr
