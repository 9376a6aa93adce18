"""Shared moulds and states, small enough for slow twins."""

import os
from functools import partial

# Before NumPy and torch are imported: tests run in as many processes as there are cores.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import pytest
import shapely

from raptor.condor import simulate
from raptor.condor.lattice import build_lattice
from raptor.moulds import Circle, Mould
from raptor.parameters import CellParameters, NetworkModel
from tests.small import ROOT, build

FINISHED = ("test_dag.py", "test_end_to_end.py", "test_report.py", "test_slurm.py")
"""Files that look at the tiny run of the workflow."""


def pytest_xdist_make_scheduler(config, log):
    """One worker for each file, and one for all that look at the tiny run: what they share is made once."""
    from xdist.scheduler import LoadScopeScheduling

    class ByWhatIsShared(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            file = nodeid.split("::")[0]
            return "finished" if file.endswith(FINISHED) else file

    return ByWhatIsShared(config, log)


def pytest_collection_modifyitems(items):
    """What looks at the tiny run first, then the other long files, so that both workers end together."""
    folders = [ROOT / "tests" / name for name in ("workflow", "physics", "unit")]

    def place(item):
        return item.path.name not in FINISHED, *(folder not in item.path.parents for folder in folders)

    items.sort(key=place)


def pytest_addoption(parser):
    parser.addoption(
        "--roundings", type=int, default=0, metavar="N",
        help="run each test N times, with last bits of every state at casting changed at random: a "
        "simulation then ends in another of its many states, as it does on another processor",
    )  # fmt: skip


def pytest_generate_tests(metafunc):
    if count := metafunc.config.getoption("roundings"):
        metafunc.parametrize("rounding", range(count), indirect=True)


@pytest.fixture(autouse=True)
def rounding(request, monkeypatch):
    """States at casting that differ in their last bits, where `--roundings` asks for them."""
    if not hasattr(request, "param"):
        return
    cast = simulate.cast_state

    def rounded(sites, rng):
        noise = np.random.default_rng(request.param).normal(size=6 * len(sites))
        return cast(sites, rng) * (1 + 2e-16 * noise)

    monkeypatch.setattr(simulate, "cast_state", rounded)


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """A results folder; read it, do not change it."""
    return build(tmp_path_factory.mktemp("made") / "unit", 4)


@pytest.fixture
def quick_fits(monkeypatch):
    """Fits by a surrogate in seconds: fewer starts, fewer steps, fewer points of the posterior."""
    from raptor.fitting import command, least_squares, posterior  # with torch, which few tests need

    monkeypatch.setattr(command, "minimise", partial(least_squares.minimise, starts=4))
    monkeypatch.setattr(command, "survey", partial(posterior.survey, points=16))
    monkeypatch.setattr(command, "infer", partial(posterior.infer, dense=2**12))
    monkeypatch.setattr(least_squares, "REFINED", 1)
    monkeypatch.setattr(least_squares, "MOST_STEPS", 4)


@pytest.fixture
def small_mould():
    return Mould(shapely.box(-5.2, -3.3, 5.4, 3.1), (Circle(2.0, 0.5, 1.1),), name="small")


@pytest.fixture
def parameters():
    return CellParameters(0.6, 0.4, 0.2)


@pytest.fixture
def model():
    return NetworkModel(3)


@pytest.fixture
def lattice(small_mould, parameters, model):
    return build_lattice(small_mould, parameters, model)


@pytest.fixture
def random_state(lattice):
    """A disturbed lattice, far enough out of the mould that walls push back."""
    rng = np.random.default_rng(7)
    positions = lattice.sites + rng.normal(0, 0.25, lattice.sites.shape)
    return np.concatenate([positions.T.ravel(), rng.normal(size=3 * lattice.cells)])
