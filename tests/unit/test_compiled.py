"""Compiled kernels: the same bits whatever was compiled, loaded or called before, and wherever."""

import os
import subprocess
import sys

import llvmlite.binding
import numpy as np
import pytest

from raptor.core.compiled import CACHE_FOLDER, kernel

pytestmark = pytest.mark.one_processor

RUN = """
import hashlib, sys
import numpy, shapely
from raptor.condor import energy, minimise, system
from raptor.condor.simulate import simulate
from raptor.moulds import Circle, Mould
from raptor.parameters import CellParameters, NetworkModel

mould = Mould(shapely.box(-5, -4, 5, 4), (Circle(2, 0, 1),))
parameters, model = CellParameters(0.6, 0.5, 0.3), NetworkModel(1)
if "parts first" in sys.argv:
    made = system.build_system(mould, parameters, model)
    state = system.cast_state(made.lattice.sites, numpy.random.default_rng(0))
    work = minimise._workplace(state)
    energy.objective(state, made.network, made.walls, 0.6)
    minimise._dot(state, state)
    minimise._keep_kernel(state, work)
    minimise._direction_kernel(work)
for accuracy in ("draft", "standard"):
    tissue = simulate(mould, parameters, model, accuracy, seed=1)
    bits = tissue.positions.tobytes() + tissue.orientation.tobytes() + tissue.tension.tobytes()
    print(accuracy, repr(float(tissue.energy)), hashlib.sha256(bits).hexdigest())
"""
ANOTHER = {"NUMBA_CPU_NAME": "x86-64-v3", "NUMBA_CPU_FEATURES": "", "OPENBLAS_CORETYPE": "Haswell"}
"""A processor of 2013, with narrower registers."""

FUSES = (
    "x86_64" in llvmlite.binding.get_process_triple()
    and llvmlite.binding.get_host_cpu_features()["fma"]
    and "NUMBA_CPU_NAME" not in os.environ
)
"""Whether this processor can stand in for that one."""


def started(code, *arguments, **environment):
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.Popen(
        command, env=os.environ | environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def said(process):
    out, err = process.communicate()
    assert process.returncode == 0, err[-2000:]
    return out, err


def test_a_simulation_has_the_same_bits_whatever_the_cache_and_the_processor(tmp_path):
    """From an empty cache and as if on another processor; from a full one, whatever is called first."""
    cold = started(RUN, NUMBA_CACHE_DIR=str(tmp_path), **(ANOTHER if FUSES else {}))
    warm, parts = said(started(RUN)), said(started(RUN, "parts first"))
    assert said(cold) == warm == parts
    assert warm[1] == ""


def test_processes_that_fill_a_cache_at_once_leave_it_whole(tmp_path):
    """Two compile one kernel for two types at the same time; a third loads both."""
    code = """
import numpy as np
from raptor.condor.minimise import _largest
print(_largest(np.ones(9)), _largest(np.ones(9, np.float32)), sum(_largest.stats.cache_hits.values()))
"""
    both = [started(code, NUMBA_CACHE_DIR=str(tmp_path)) for _ in range(2)]
    for out, err in map(said, both):
        assert out.startswith("1.0 1.0 ")
        assert err == ""
    assert said(started(code, NUMBA_CACHE_DIR=str(tmp_path))) == ("1.0 1.0 2\n", "")


def test_where_the_cache_cannot_be_written_one_sentence_says_so():
    code = """
import numpy as np
from raptor.condor.minimise import _largest
print(_largest(np.ones(9)), _largest(np.ones(9, np.float32)))
"""
    out, err = said(started(code, NUMBA_CACHE_DIR="/dev/null/none"))
    assert out == "1.0 1.0\n"
    assert err.count("\n") == 1
    assert err.startswith("compiled kernels cannot be stored in /dev/null/none/")


def test_a_damaged_cache_is_replaced():
    twice(3)
    for path in CACHE_FOLDER.glob("test_compiled.twice*.nbc"):
        path.write_bytes(path.read_bytes()[:100])
    again = kernel(twice.py_func)
    assert again(3) == 6


@kernel
def twice(number):
    return 2 * number


def test_sums_are_taken_in_order():
    """No flag lets the compiler regroup: numbers this far apart would tell."""
    numbers = np.array([1e16, 1.0, -1e16, 1.0] * 8)
    assert in_order(numbers) == 1.0


@kernel
def in_order(numbers):
    total = 0.0
    for number in numbers:
        total += number
    return total
