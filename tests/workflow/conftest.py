"""One real run of the tiny configuration, which the workflow tests look at."""

import pytest

from tests.workflow.place import Workplace


@pytest.fixture(scope="session")
def workplace(tmp_path_factory):
    return lambda name: Workplace(tmp_path_factory.mktemp("work") / name)


@pytest.fixture(scope="session")
def finished(workplace):
    """The tiny run, from nothing to the report."""
    place = workplace("finished")
    place.result = place.run("--cores", "2")
    return place


@pytest.fixture
def place(finished):
    """The folder of the tiny run, which ended well."""
    assert finished.result.returncode == 0, finished.result.stderr[-3000:]
    return finished


@pytest.fixture
def results(place):
    """Results of the tiny run."""
    return place.results
