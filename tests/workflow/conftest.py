"""One real run of the tiny configuration, which the workflow tests look at."""

import os
import re
import subprocess
import sys

import pytest
import yaml

from raptor.config import load, require_castable, require_measurable
from raptor.core.errors import RaptorError
from raptor.moulds.library.tissues import load_tissues
from tests.small import ROOT

TINY = ROOT / "tests" / "workflow" / "config" / "tiny.yaml"


class Workplace:
    """A folder to run the workflow in; code and configuration are the project's."""

    def __init__(self, folder):
        self.folder = folder
        folder.mkdir(exist_ok=True)

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


class Parsed:
    """What the Snakefile does with a configuration before any rule is read, without a Snakemake."""

    Error = RaptorError

    def __call__(self, path):
        configuration = load(path)
        require_castable(configuration)
        tissues = load_tissues(configuration.fit.tissues_file, configuration.fit.tissues)
        require_measurable(tissues, configuration.mould_scale)
        return configuration


@pytest.fixture
def parsed():
    return Parsed()


def variant(tmp_path, **changes):
    """The tiny configuration with other values, keys given as block__key."""
    content = yaml.safe_load(TINY.read_text())
    for key, value in changes.items():
        block, _, name = key.partition("__")
        if name:
            content.setdefault(block, {})[name] = value
        else:
            content[block] = value
    path = tmp_path / "variant.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return path


@pytest.fixture(scope="session")
def workplace(tmp_path_factory):
    return lambda name: Workplace(tmp_path_factory.mktemp("work") / name)


@pytest.fixture(scope="session")
def finished(workplace):
    """The tiny run, from nothing to the report."""
    place = workplace("finished")
    place.result = place.run("--cores", "2")
    return place
