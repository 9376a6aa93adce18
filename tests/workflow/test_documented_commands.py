"""Every command that README, CONTRIBUTING and docs show, in blocks marked `bash` or in the text.

Snakemake's commands are dry runs. `raptor` and `python -m` are run for real, page by page, on a desk with the
files that a reader would have; the small data set stands in for finished runs. A command whose comment gives
minutes or hours is parsed, not run.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import textwrap
from importlib.util import find_spec

import pytest
import typer
from PIL import Image

from raptor.cli import app
from raptor.dataset.publish import publish
from tests.photograph import CASES
from tests.small import MINI, ROOT
from tests.workflow.place import snakemake

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^ *```(\w*)\n(.*?)^ *```", re.DOTALL | re.MULTILINE)
LONG = re.compile(r"#.*\b(minutes?|hours?|core-hours)\b")
ENVIRONMENT = os.environ | {"PYTHONPATH": f"{ROOT / 'src'}:{ROOT}"}


def shown(page):
    """Lines of a page's shell blocks, those that go on in the next joined."""
    blocks = [block for language, block in BLOCK.findall(page.read_text()) if language == "bash"]
    lines = "\n".join(textwrap.dedent(block) for block in blocks).replace("\\\n", " ").splitlines()
    return [re.sub(r" {2,}", " ", line) for line in lines if line and not line.startswith("#")]


def words(line):
    """A command's arguments: without comment, settings of the environment and workflow/env."""
    found = [word for word in shlex.split(line, comments=True) if not re.match(r"[A-Z_]+=", word)]
    return found[found[0] == "workflow/env" :]


LINES = {page: shown(page) for page in PAGES}
CONFIGURATIONS = {
    block.split("\n")[0].removeprefix("name: "): block
    for page in PAGES
    for language, block in BLOCK.findall(page.read_text())
    if language == "yaml" and block.startswith("name: ")
}
DRY_RUNS = sorted(
    {
        tuple(word for word in words(line) if word != "--dry-run")
        for lines in LINES.values()
        for line in lines
        if "snakemake " in line
    }
)


@pytest.fixture(scope="module")
def made_photograph():
    return CASES[0].made()[2]


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    folder = tmp_path_factory.mktemp("published") / "publish"
    publish(folder, MINI, ["paper"], {}, ROOT)
    return folder


@pytest.fixture
def desk(tmp_path, monkeypatch, made_photograph, published):
    """A folder like the project's, with finished runs and a reader's own files."""
    for name in ("config", "workflow", "Snakefile", "src", "pyproject.toml"):
        (tmp_path / name).symlink_to(ROOT / name)
    for name in ("mini", "laptop", "paper"):
        shutil.copytree(MINI, tmp_path / "results" / name)
    shutil.copytree(published, tmp_path / "results" / "laptop" / "publish")
    shutil.copytree(ROOT / "tests" / "data", tmp_path / "tests" / "data")
    (tmp_path / "docs" / "images").mkdir(parents=True)
    shutil.copy(ROOT / "tests" / "data" / "moulds" / "dog_bone.svg", tmp_path / "mould.svg")
    (tmp_path / "photographs").mkdir()
    for name in ("photograph.png", "photographs/01_four_post_rectangle.png"):
        Image.fromarray(made_photograph).save(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def parse(arguments):
    """A command's context; wrong names, options and types raise."""
    group = typer.main.get_command(app)
    with group.make_context("raptor", arguments[:1], resilient_parsing=True) as context:
        name, command, _ = group.resolve_command(context, arguments)
        return command.make_context(name, arguments[1:])


def run(command, long):
    """Run a command in the current folder, or parse it where it takes long."""
    if command[0] == "raptor":
        parse(command[1:])
        if not long:
            assert not app(command[1:], standalone_mode=False), shlex.join(command)
    elif command[:2] == ["python", "-m"]:
        assert find_spec(command[2]), shlex.join(command)
        if not long:
            subprocess.run([sys.executable, *command[1:]], check=True, env=ENVIRONMENT)
    elif command[0] == "pytest":
        if len(command) > 1:
            collected = [sys.executable, "-m", *command, "--collect-only", "-q"]
            subprocess.run(collected, check=True, cwd=ROOT, env=ENVIRONMENT)
    elif (ROOT / command[0]).is_file():
        assert long and os.access(ROOT / command[0], os.X_OK), shlex.join(command)
    else:
        assert command[0] in ("snakemake", "uv", "python"), f"{shlex.join(command)} is not known to this test"


@pytest.mark.parametrize("page", [page for page in PAGES if LINES.get(page)], ids=lambda page: page.name)
def test_a_page_s_commands_run(page, desk):
    for line in LINES[page]:
        if line.startswith(("cp ", "mkdir ")):
            subprocess.run(["bash", "-c", line], check=True)
        else:
            run(words(line), LONG.search(line))


@pytest.mark.parametrize("command", DRY_RUNS, ids=shlex.join)
def test_a_dry_run_finds_its_rules(command, tmp_path):
    for name in ("config", "workflow", "Snakefile"):
        (tmp_path / name).symlink_to(ROOT / name)
    for name, text in CONFIGURATIONS.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    shutil.copy(ROOT / "tests" / "data" / "moulds" / "dog_bone.geojson", tmp_path / "my_mould.geojson")
    shutil.copytree(ROOT / "tests" / "data" / "moulds", tmp_path / "my_moulds")
    (tmp_path / "my_moulds" / "dog_bone.geojson").unlink()  # drawn in the others too
    (tmp_path / "my_moulds" / "dog_bone.png").unlink()
    assert command[0] == "snakemake"
    done = snakemake(*command[1:], "--dry-run", folder=tmp_path)
    assert done.returncode == 0, done.stderr[-2000:]
    assert "This was a dry-run" in done.stdout + done.stderr


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_in_the_text_are_right(page):
    for span in re.findall(r"`(raptor \w+ [^`]+)`", BLOCK.sub("", page.read_text())):
        if "..." not in span:
            parse(shlex.split(span)[1:])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_shell_blocks_are_marked(page):
    for language, block in BLOCK.findall(page.read_text()):
        assert language, block
        assert "workflow/env" not in block or language == "bash"
