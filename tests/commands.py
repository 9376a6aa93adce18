"""Commands in this process, which need no start of Python: the command line, modules and blocks of a page."""

import re
import runpy
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from subprocess import CompletedProcess
from unittest.mock import patch

import pytest

from raptor.cli import main


def raptor(*arguments):
    """What a command of raptor returns and prints."""
    command, out, err = list(map(str, arguments)), StringIO(), StringIO()
    with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as end:
        main(command)
    return CompletedProcess(command, end.value.code or 0, out.getvalue(), err.getvalue())


def options(delta=0.5, nnn=0.5, nnnn=0.3):
    """Parameters as flags."""
    return ("--delta", delta, "--kappa-nnn", nnn, "--kappa-nnnn", nnnn)


def module(name, *arguments):
    """What `python -m name ...` prints."""
    printed, command = StringIO(), [name, *map(str, arguments)]
    with patch.object(sys, "argv", command), redirect_stdout(printed), pytest.raises(SystemExit) as end:
        runpy.run_module(name, run_name="__main__", alter_sys=True)
    assert not end.value.code, printed.getvalue()
    return printed.getvalue()


def python_blocks(page):
    """Python code of a page, block by block."""
    return re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL)


def executed(code):
    """What code prints."""
    printed = StringIO()
    with redirect_stdout(printed):
        exec(code, {"__name__": "__main__"})
    return printed.getvalue()
