"""The wheel: it brings weights, moulds and tissues, and works without a checkout."""

import os
import subprocess
import sys
import zipfile

from hatchling.builders.wheel import WheelBuilder

from tests.small import ROOT

SCRIPT = """
import raptor
print(raptor.__file__)
print(raptor.predict("small_rectangle", raptor.tissue("glial_1").fit).area_ratio)
"""


def test_a_wheel_predicts_outside_the_checkout(tmp_path):
    (wheel,) = WheelBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "site")}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    file, ratio = done.stdout.splitlines()
    assert file == str(tmp_path / "site" / "raptor" / "__init__.py")
    assert 0.5 < float(ratio) < 1
