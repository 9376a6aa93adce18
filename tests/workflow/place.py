"""Folders to run the workflow in, and Snakemake without a start of Python for each call."""

import multiprocessing
import os
import re
import sys
from pathlib import Path
from subprocess import CompletedProcess
from tempfile import TemporaryDirectory

import yaml

from raptor.config import checked
from raptor.core.blocks import read_yaml
from tests.small import ROOT

TINY = ROOT / "tests" / "workflow" / "config" / "tiny.yaml"
PROFILES = ROOT / "workflow" / "profiles"

ENVIRONMENT = os.environ | {"SNAKEMAKE_PROFILE": str(PROFILES / "default")}

FORKED = multiprocessing.get_context("forkserver")
FORKED.set_forkserver_preload(
    ["snakemake.cli", "snakemake_executor_plugin_slurm", "raptor.config", "raptor.surrogate.baselines"]
)


def snakemake(*arguments, folder):
    """Run Snakemake's command line in a folder, in a process forked from one that has imported it."""
    with TemporaryDirectory() as printed:
        files = [Path(printed, name) for name in ("stdout", "stderr")]
        child = FORKED.Process(target=_forked, args=([*map(str, arguments)], str(folder), files))
        child.start()
        child.join()
        return CompletedProcess(arguments, child.exitcode, *(file.read_text() for file in files))


def _forked(arguments, folder, files):
    for number, file in enumerate(files, start=1):
        with file.open("w") as opened:
            os.dup2(opened.fileno(), number)
    os.chdir(folder)
    os.environ.update(ENVIRONMENT)
    sys.argv = ["snakemake", *arguments]
    from snakemake.cli import main

    main(arguments)


class Workplace:
    """A folder to run the workflow in; code and configuration are the project's."""

    def __init__(self, folder):
        self.folder = folder
        folder.mkdir(exist_ok=True)

    @property
    def results(self):
        return self.folder / "results" / "tiny"

    def arguments(self, *arguments, configuration=TINY):
        """Arguments of Snakemake for this folder."""
        return (
            "--snakefile", str(ROOT / "Snakefile"), "--directory", str(self.folder),
            "--configfile", str(configuration), *arguments,
        )  # fmt: skip

    def command(self, *arguments, configuration=TINY):
        """The command that a process of its own runs."""
        return [sys.executable, "-m", "snakemake", *self.arguments(*arguments, configuration=configuration)]

    def run(self, *arguments, configuration=TINY):
        return snakemake(*self.arguments(*arguments, configuration=configuration), folder=self.folder)

    def jobs(self, *arguments, configuration=TINY):
        """Rules that a run would execute, by a dry run."""
        done = self.run("--dry-run", *arguments, configuration=configuration)
        assert done.returncode == 0, done.stderr
        return set(re.findall(r"^(?:local)?rule (\w+):", done.stderr + done.stdout, re.MULTILINE))


def parsed(path):
    """What the Snakefile does with a configuration before any rule is read."""
    return checked(read_yaml(path), str(path), [path.parent])


def variant(folder, **changes):
    """The tiny configuration with other values, keys given as block__key, as a file in a folder."""
    content = yaml.safe_load(TINY.read_text())
    content["searches"] = {name: str(TINY.parent / path) for name, path in content["searches"].items()}
    for key, value in changes.items():
        block, _, name = key.partition("__")
        if name:
            content.setdefault(block, {})[name] = value
        else:
            content[block] = value
    path = folder / "variant.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return path
