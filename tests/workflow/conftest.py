"""One real run of the tiny configuration, which the workflow tests look at."""

import os
import re
import subprocess
import sys

import pytest

from tests.small import ROOT

TINY = ROOT / "tests" / "workflow" / "config" / "tiny.yaml"


class Workplace:
    """A folder to run the workflow in; code and configuration are the project's."""

    def __init__(self, folder):
        self.folder = folder
        folder.mkdir(exist_ok=True)
        (folder / "config").symlink_to(ROOT / "config")

    def command(self, *arguments, configuration=TINY):
        return [
            sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile"),
            "--directory", str(self.folder), "--configfile", str(configuration), *arguments,
        ]  # fmt: skip

    def run(self, *arguments, configuration=TINY):
        environment = os.environ | {"SNAKEMAKE_PROFILE": str(ROOT / "workflow" / "profiles" / "default")}
        return subprocess.run(
            self.command(*arguments, configuration=configuration),
            capture_output=True, text=True, check=False, env=environment, cwd=self.folder,
        )  # fmt: skip

    def jobs(self, *arguments, configuration=TINY):
        """Rules that a run would execute, by a dry run."""
        done = self.run("--dry-run", *arguments, configuration=configuration)
        assert done.returncode == 0, done.stderr
        return set(re.findall(r"^(?:local)?rule (\w+):", done.stderr + done.stdout, re.MULTILINE))


def pytest_collection_modifyitems(items):
    """What looks at the tiny run is one group, so that one worker makes it, once, beside the other tests."""
    for item in items:
        if "finished" in item.fixturenames:
            item.add_marker(pytest.mark.xdist_group("finished"))


@pytest.fixture(scope="session")
def workplace(tmp_path_factory):
    return lambda name: Workplace(tmp_path_factory.mktemp("work") / name)


@pytest.fixture(scope="session")
def finished(workplace):
    """The tiny run, from nothing to the report."""
    place = workplace("finished")
    place.result = place.run("--cores", "2")
    return place
