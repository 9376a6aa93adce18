"""docs/python.md: its blocks run, one after another, and print what the page shows, numbers aside.

`python -m tests.unit.test_python_page` writes what they print now into the page.
"""

import os
import re
import shutil
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.small import ROOT

pytestmark = pytest.mark.one_processor

PAGE = ROOT / "docs" / "python.md"
BLOCK = re.compile(r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", re.DOTALL)


def run(folder):
    """Code of each block, what the page shows of it and what it prints, run in a folder."""
    shutil.copy(ROOT / "tests" / "data" / "moulds" / "dog_bone.svg", folder / "mould.svg")
    names = {}
    for code, shown in BLOCK.findall(PAGE.read_text()):
        printed = StringIO()
        with redirect_stdout(printed):
            exec(code, names)
        yield code, shown, printed.getvalue()


def masked(text):
    """Text with every number of it replaced: they differ between machines."""
    return re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "#", " ".join(text.split()))


def test_the_page_s_blocks_print_what_it_shows(tmp_path, monkeypatch, quick_fits):
    monkeypatch.chdir(tmp_path)
    for code, shown, printed in run(tmp_path):
        assert masked(printed) == masked(shown), code
    assert len(list(tmp_path.glob("*.png"))) == 4


def write():
    """Write what the blocks print into the page."""
    with TemporaryDirectory() as folder:
        os.chdir(folder)
        page = PAGE.read_text()
        for code, shown, printed in run(Path(folder)):
            page = page.replace(f"{code}```\n\n```text\n{shown}```", f"{code}```\n\n```text\n{printed}```")
    PAGE.write_text(page)


if __name__ == "__main__":
    write()
