"""docs/python.md: its blocks run, one after another, and print what the page shows, numbers aside."""

import re
import shutil
from contextlib import redirect_stdout
from io import StringIO

from raptor.fitting import command, least_squares
from tests.small import ROOT

PAGE = ROOT / "docs" / "python.md"
BLOCK = re.compile(r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", re.DOTALL)


def masked(text):
    """Text with every number of it replaced: they differ between machines."""
    return re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "#", " ".join(text.split()))


def test_the_page_s_blocks_print_what_it_shows(tmp_path, monkeypatch):
    shutil.copy(ROOT / "tests" / "data" / "moulds" / "dog_bone.svg", tmp_path / "mould.svg")
    monkeypatch.chdir(tmp_path)
    for module, name, few in ((command, "STARTS", 4), (least_squares, "REFINED", 1), (command, "POINTS", 16)):
        monkeypatch.setattr(module, name, few)  # a fit in seconds
    names = {}
    for code, shown in BLOCK.findall(PAGE.read_text()):
        printed = StringIO()
        with redirect_stdout(printed):
            exec(code, names)
        assert masked(printed.getvalue()) == masked(shown), code
    assert len(list(tmp_path.glob("*.png"))) == 4
