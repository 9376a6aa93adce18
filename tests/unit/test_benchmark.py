"""The benchmark runs, and its baselines compute the same physics."""

import json
import subprocess
import sys

import numpy as np
import pytest
from benchmarks.baselines import gradient_by_bonds, gradient_by_neighbours, neighbour_table, torch_gradient

from raptor.condor.energy import objective, unit_orientations
from raptor.condor.network import build_network
from raptor.condor.walls import NO_WALLS
from tests.commands import module
from tests.workflow.place import variant

pytestmark = pytest.mark.one_processor


def test_baselines_have_the_energy_and_gradient_of_the_kernel(lattice, random_state):
    state = unit_orientations(random_state)
    energy, _, wanted = objective(state, build_network(lattice), NO_WALLS, 0.6)
    found = {name: np.empty_like(state) for name in ("neighbours", "bonds")}
    bonds = (lattice.first, lattice.second, lattice.stiffness, lattice.rest_length)
    energies = [
        gradient_by_neighbours(state, found["neighbours"], neighbour_table(lattice), 0.6),
        gradient_by_bonds(state, found["bonds"], *bonds, 0.6),
    ]
    last, found["torch"] = torch_gradient(lattice, 0.6)(state)
    assert [*energies, last] == pytest.approx([energy] * 3, rel=1e-10)
    orientations = state.reshape(6, -1)[3:]
    for gradient in found.values():
        blocks = gradient.reshape(6, -1)
        blocks[3:] -= (blocks[3:] * orientations).sum(axis=0) * orientations
        assert np.abs(blocks.ravel() - wanted).max() < 1e-9 * np.abs(wanted).max()


def test_the_benchmark_prints_its_tables():
    printed = module("benchmarks", "--quick")
    for title in ("Gradient", "bounds", "Trial moves", "Whole runs", "to the power"):
        assert title in printed


def test_the_gpu_script_runs_whole_on_a_processor(tmp_path):
    """A design of tissues that contract little, which takes few steps."""
    output, little = tmp_path / "gpu.json", {"runs": 8, "test": 2, "validation": 2, "delta": [0.05, 0.1]}
    configuration = variant(tmp_path, campaigns__paper=little, random_moulds__cells=[60, 100])
    command = [  # a process of its own, for it forks others
        sys.executable, "-m", "benchmarks.gpu", str(configuration),
        "--output", str(output), "--device", "cpu", "--simulations", "2", "--checked", "2", "--channels", "2",
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    found = json.loads(output.read_text())
    assert found["agreement"]["moulds"] == found["agreement"]["converged"] == 2
    assert found["design"]["simulations"] == 2
    assert found["design"]["of"] == 8
    for row in ("all of them, extrapolated", "training, samples a second", "of the measured arithmetic"):
        assert row in done.stdout
