"""Lint, format and types; rules; what jobs wait for."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.small import ROOT
from tests.workflow.place import snakemake


def run(*command, **options):
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, **options)


@pytest.mark.parametrize(
    "command",
    [
        ("ruff", "check", "."),
        ("ruff", "format", "--check", "."),
        ("snakefmt", "--check", "Snakefile", "workflow"),
        ("mypy",),
    ],
    ids=" ".join,
)
def test_clean(command):
    folder = Path(sys.executable).parent
    done = run(f"{folder}/{command[0]}", *command[1:])
    assert done.returncode == 0, done.stdout + done.stderr


def test_snakemake_lint():
    done = snakemake("--lint", folder=ROOT)
    found = set(re.findall(r"^    \* (.+)$", done.stdout + done.stderr, re.MULTILINE))
    # workflow/env provides one locked environment for all rules, without conda or containers.
    assert found == {"Specify a conda environment or container for each rule.:"}, done.stderr


def test_every_rule_is_complete():
    for path in [ROOT / "Snakefile", *(ROOT / "workflow" / "rules").glob("*.smk")]:
        for rule in path.read_text().split("\nrule ")[1:]:
            name, body = rule.split(":", 1)
            body = body.split("\n\n\n")[0]
            assert '"""' in body or name == "all", f"{name} has no docstring"
            if "script:" in body:
                for directive in ("output", "log", "benchmark", "threads", "resources"):
                    assert f"    {directive}:" in body, f"{name} has no {directive}"


def test_a_simulation_job_leaves_heavy_imports_alone():
    modules = (
        "raptor.dataset.design, raptor.dataset.shards, raptor.dataset.run, raptor.core.jobs, raptor.moulds"
    )
    heavy = "{'torch', 'xarray', 'pandas', 'matplotlib', 'pydantic'}"
    done = run(sys.executable, "-c", f"import sys, {modules}; print({heavy} & set(sys.modules))")
    assert done.stdout.strip() == "set()", done.stdout + done.stderr


def test_kernels_agree_with_their_twins_without_compilation():
    tests = ["tests/unit/test_fields.py", "tests/physics/test_energy.py"]
    chosen = "slow_twin or exact or opposite"
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = run(sys.executable, "-m", "pytest", "-q", "-k", chosen, *tests, env=environment)
    assert done.returncode == 0, done.stdout[-2000:]
    assert " passed" in done.stdout
