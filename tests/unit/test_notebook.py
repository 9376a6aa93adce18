"""docs/notebook.ipynb: it runs from beginning to end, and what it says of its numbers holds.

`python -m tests.unit.test_notebook` executes it and keeps in it what it prints and draws now.
"""

import os
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
import pytest
from jupyter_client import AsyncKernelManager
from jupyter_client.kernelspec import KernelSpecManager
from nbclient import NotebookClient

from tests.small import ROOT
from tests.unit.test_python_page import masked

pytestmark = pytest.mark.one_processor

PAGE = ROOT / "docs" / "notebook.ipynb"
PROBE = """
from IPython.display import JSON
JSON({
    "unusual": prediction.unusual,
    "error": error.to_dict(),
    "band": compared["95 % band, +-"].to_dict(),
    "distance": distance,
    "floor": floor,
    "delta": fit.parameters.delta,
    "delta_interval": fit.intervals["delta"],
    "fitted": [fit.area_ratio, fit.width_ratio],
    "open": fit.open,
    "own": tested["vrmse_density"].tolist(),
    "as_cast": tested["vrmse_density_as_cast"].tolist(),
    "own_unusual": raptor.predict(mould, cells, own).unusual,
})
"""
"""Run after the notebook: the values that matter."""


def executed(notebook, folder):
    """The notebook, run in a folder by this Python, whatever kernels and settings of Jupyter a user has."""
    own = KernelSpecManager(kernel_dirs=[])  # the one that ipykernel brings
    kernel = AsyncKernelManager(
        kernel_spec_manager=own, transport="ipc", connection_file=str(folder / "kernel.json")
    )
    place = {"metadata": {"path": str(folder)}}
    options = {"timeout": 600, "record_timing": False, "coalesce_streams": True}
    client = NotebookClient(notebook, km=kernel, resources=place, **options)
    environment = os.environ | {"TMPDIR": str(folder), "IPYTHONDIR": str(folder / "ipython")}
    return client.execute(env=environment, cleanup_kc=True)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """The notebook as it runs here, and after it the values that matter."""
    notebook = nbformat.read(PAGE, 4)
    notebook.cells.append(nbformat.v4.new_code_cell(PROBE))
    return executed(notebook, tmp_path_factory.mktemp("notebook"))


@pytest.fixture(scope="module")
def found(done):
    return done.cells[-1].outputs[0].data["application/json"]


def outputs(notebook):
    """Kinds of output of each code cell, and what it prints, numbers aside."""
    for cell in notebook.cells:
        if cell.cell_type == "code":
            printed = "".join(each.text for each in cell.outputs if each.output_type == "stream")
            yield (
                [(each.output_type, *sorted(each.get("data", ()))) for each in cell.outputs],
                masked(printed),
            )


def test_the_notebook_keeps_the_outputs_that_it_gives(done):
    kept = nbformat.read(PAGE, 4)
    for (ours, printed), (theirs, shown) in zip(outputs(kept), outputs(done), strict=False):
        assert (ours, printed) == (theirs, shown)
    code = [cell for cell in kept.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    given = [each for cell in code for each in cell.outputs]
    assert sum("image/png" in each.get("data", ()) for each in given) == 6
    assert PAGE.stat().st_size < 600_000  # GitHub shows it
    assert not any(each.output_type == "error" or each.get("name") == "stderr" for each in given)


def test_prediction_and_simulation_agree_within_the_bands(found):
    assert found["unusual"] == ""
    assert found["error"].keys() == found["band"].keys()
    for name, error in found["error"].items():
        assert error < found["band"][name]
    assert found["distance"] < min(3 * found["floor"], 0.2)


def test_the_fit_gives_the_ratios_and_leaves_the_kappas_open(found):
    low, high = found["delta_interval"]
    assert low < found["delta"] < high < low + 0.2
    assert found["fitted"] == pytest.approx([0.75, 0.73], abs=0.01)
    assert found["open"] == ["kappa_nnn", "kappa_nnnn"]


def test_the_trained_network_is_better_than_nothing_and_knows_its_limits(found):
    assert len(found["own"]) == 4
    assert 0 < sum(found["own"]) < 0.85 * sum(found["as_cast"])
    assert found["own_unusual"]


def write():
    """Execute the notebook, and keep its outputs in it."""
    notebook = nbformat.read(PAGE, 4)
    with TemporaryDirectory() as folder:
        executed(notebook, Path(folder))
    notebook.metadata.language_info = {"name": "python"}
    nbformat.write(notebook, PAGE)


if __name__ == "__main__":
    write()
