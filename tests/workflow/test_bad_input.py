"""Bad input stops before any job starts, with one clear sentence and a non-zero status."""

import pytest
import yaml

from raptor.core.errors import RaptorError
from tests.workflow.place import parsed, variant

CASE = {"mould": "small_rectangle", "delta": 0.5, "kappa_nnn": 0.5, "kappa_nnnn": 0.3}
PAPER = {"runs": 8, "test": 2, "validation": 2}
GRID = {"delta": [0.5], "kappa_nnn": [0.5], "ratio": [0.5]}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"campains": {}}, "unknown key 'campains'; did you mean 'campaigns'?"),
        (
            {"campaigns__paper": PAPER | {"runz": 3}},
            "unknown key 'campaigns.paper.runz'; did you mean 'runs'?",
        ),
        ({"campaigns__paper": PAPER | {"test": 7}}, "are more than the 8 runs"),
        ({"campaigns__paper": PAPER | {"delta": [0.0, 0.95]}}, "delta is [0.0, 0.95]"),
        ({"campaigns__paper": PAPER | {"kappa_nnnn": [0.6, 0.7]}}, "within [0.01, 0.5]"),
        ({"campaigns__sweep": {"moulds": "i_shape", "grid": GRID | {"ratio": [0.8]}}}, "kappa_nnn/sqrt(2)"),
        ({"campaigns__sweep": {"moulds": "none.geojson", "grid": GRID}}, "none.geojson"),
        ({"pixels": 100}, "pixels"),
        ({"random_moulds__cells": [100, 400000]}, "more than 2 layers hold"),
        ({"tradeoff__methods": ["perfect"]}, "accuracy is 'perfect'; allowed are draft"),
        ({"tradeoff__methods": ["24 pixels"]}, "neither a divisor nor a multiple of pixels"),
        (
            {"tradeoff__cases": {"one": CASE | {"dleta": 0.5}}},
            "'tradeoff.cases.one.dleta'; did you mean 'delta'?",
        ),
        ({"tradeoff__cases": {"one": CASE | {"mould": "none.geojson"}}}, "none.geojson"),
        ({"fit__tissues": ["glial"]}, "has no tissue 'glial'; did you mean 'glial_"),
        ({"fit__tissues": ["myoblast"]}, "cannot be fitted; simulate it as a campaign"),
        ({"fit__tissues_file": "none.yaml"}, "none.yaml cannot be read"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_a_bad_configuration(tmp_path, change, message):
    """In process: what the Snakefile does first."""
    with pytest.raises(RaptorError) as caught:
        parsed(variant(tmp_path, **change))
    assert message in str(caught.value)


def test_a_bad_mould_of_a_tissue(workplace, tmp_path):
    """By Snakemake: one sentence, no traceback, nothing made."""
    (tmp_path / "cross.geojson").write_text(
        '{"type": "Polygon", "coordinates": [[[0, 0], [5, 5], [5, 0], [0, 5], [0, 0]]]}'
    )
    tissue = {"description": "x", "mould": str(tmp_path / "cross.geojson"), "area_ratio": 0.8}
    (tmp_path / "tissues.yaml").write_text(yaml.safe_dump({"mine": tissue}))
    change = {"fit__tissues": ["mine"], "fit__tissues_file": str(tmp_path / "tissues.yaml")}
    place = workplace("cross")
    done = place.run("--cores", "1", configuration=variant(tmp_path, **change))
    assert done.returncode != 0
    assert "not a simple polygon" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (place.folder / "results").exists()
