import numpy as np
import pytest

from raptor.condor.energy import CONTACT_LENGTH, cell_tension, inverted_fraction, objective
from raptor.condor.lattice import build_lattice
from raptor.condor.network import build_network
from raptor.condor.walls import NO_WALLS, STIFFNESS, build_walls
from raptor.core.errors import RaptorError
from raptor.parameters import CellParameters, NetworkModel
from tests import naive


@pytest.fixture
def network(lattice):
    return build_network(lattice)


@pytest.fixture
def walls(small_mould, lattice):
    return build_walls(small_mould, lattice.height)


@pytest.mark.parametrize("contact", [0.0, 100.0])
def test_gradient_is_that_of_the_energy_walls_included(network, walls, random_state, contact):
    step = 1e-5
    _, wall_energy, gradient = objective(random_state, network, walls, 0.6, contact)
    assert wall_energy > 0.1  # the state does press on walls
    numeric = np.empty_like(gradient)
    for i in range(len(random_state)):
        ends = []
        for sign in (1, -1):
            moved = random_state.copy()
            moved[i] += sign * step
            ends.append(sum(objective(moved, network, walls, 0.6, contact)[:2]))
        numeric[i] = (ends[0] - ends[1]) / (2 * step)
    assert np.linalg.norm(gradient - numeric) / np.linalg.norm(gradient) < 1e-6
    assert np.abs(gradient - numeric).max() < 1e-6 * np.abs(gradient).max()


def test_energy_is_that_of_the_slow_twin(lattice, network, walls, random_state):
    energy = objective(random_state, network, walls, 0.6)[0]
    assert energy == pytest.approx(naive.bond_energy(lattice, random_state, 0.6), rel=1e-9)


def test_contacts_are_those_of_the_slow_twin(lattice, network, random_state):
    state = random_state.copy()
    state[: 3 * lattice.cells] += 0.5 * np.random.default_rng(0).normal(size=3 * lattice.cells)
    energy = objective(state, network, NO_WALLS, 0.6, 50.0)[1]
    assert energy > 1  # some bonds are reversed
    assert energy == pytest.approx(naive.contact_energy(lattice, state, 50.0, CONTACT_LENGTH), rel=1e-9)


def test_single_precision_computes_the_same(lattice, network, walls, random_state):
    single = build_network(lattice, np.float32)
    double_energy, _, double = objective(random_state, network, walls, 0.6)
    energy, _, gradient = objective(random_state.astype(np.float32), single, walls, 0.6)
    assert energy == pytest.approx(double_energy, rel=1e-5)
    assert np.abs(gradient - double).max() < 1e-4 * np.abs(double).max()


def test_walls_are_exact_away_from_corners(small_mould, lattice, network, walls):
    # Cells pushed through straight walls, far from corners; and through the round post.
    state = np.concatenate([np.zeros(3 * lattice.cells), np.repeat([1.0, 0, 0], lattice.cells)])
    state = state.reshape(6, -1)
    state[:3] = np.array([[-5.5], [0.0], [0.4]])
    assert objective(state.ravel(), network, walls, 0.0)[1] == pytest.approx(
        naive.wall_energy(small_mould, lattice.height, state.ravel(), STIFFNESS), rel=1e-6
    )
    state[:3] = np.array([[1.2], [0.5], [0.4]])
    assert objective(state.ravel(), network, walls, 0.0)[1] == pytest.approx(
        naive.wall_energy(small_mould, lattice.height, state.ravel(), STIFFNESS), rel=0.1
    )


@pytest.mark.parametrize("kind", ["hooke", "literal"])
def test_tension_is_that_of_the_slow_twin(lattice, random_state, kind):
    tension = cell_tension(random_state, lattice, 0.6, kind)
    assert tension == pytest.approx(naive.cell_tension(lattice, random_state, 0.6, kind), rel=1e-9)


def test_opposite_orientations_are_the_same_cell(lattice, network, walls, random_state):
    flipped = random_state.copy()
    flipped.reshape(6, -1)[3:, ::2] *= -1
    a, b = (objective(state, network, walls, 0.6) for state in (random_state, flipped))
    assert a[0] == pytest.approx(b[0], rel=1e-12)


def test_without_contraction_the_cast_lattice_is_at_rest(lattice, network, walls):
    state = np.concatenate([lattice.sites.T.ravel(), np.ones(3 * lattice.cells)])
    energy, wall_energy, gradient = objective(state, network, walls, 0.0)
    assert energy < 1e-9
    assert wall_energy == 0
    assert np.abs(gradient).max() < 1e-6
    assert cell_tension(state, lattice, 0.0) == pytest.approx(0, abs=1e-6)


def test_bonds_pull_and_turn_without_net_force_or_torque(lattice, network, random_state):
    gradient = objective(random_state, network, NO_WALLS, 0.6)[2].reshape(6, -1)
    blocks = random_state.reshape(6, -1)
    assert gradient[:3].sum(axis=1) == pytest.approx(0, abs=1e-9)
    torque = np.cross(blocks[:3].T, gradient[:3].T) + np.cross(blocks[3:].T, gradient[3:].T)
    assert torque.sum(axis=0) == pytest.approx(0, abs=1e-8)


def test_cells_on_top_of_each_other_keep_a_finite_force(lattice, network, walls, random_state):
    blocks = random_state.reshape(6, -1)
    blocks[:3, lattice.second[0]] = blocks[:3, lattice.first[0]]
    energy, _, gradient = objective(random_state, network, walls, 0.9)
    assert np.isfinite(energy)
    assert np.isfinite(gradient).all()


def test_soft_bonds_are_not_built(small_mould):
    model = NetworkModel(3)
    counts = [
        build_lattice(small_mould, CellParameters(0.5, *kappas), model).bonds
        for kappas in ((0, 0), (0.3, 0), (0.3, 0.1))
    ]
    assert counts[0] < counts[1] < counts[2]


def test_folding_is_counted(lattice):
    state = np.concatenate([lattice.sites.T.ravel(), np.ones(3 * lattice.cells)])
    assert inverted_fraction(state, lattice) == 0
    state[: lattice.cells] *= -1  # mirrored in x: bonds along x reverse
    assert 0 < inverted_fraction(state, lattice) < 1
    state[: 3 * lattice.cells] = -lattice.sites.T.ravel()
    assert inverted_fraction(state, lattice) == 1


def test_a_state_of_the_wrong_size_is_named(network, walls, random_state):
    with pytest.raises(RaptorError, match="shape"):
        objective(random_state[:-1], network, walls, 0.5)
    random_state.reshape(6, -1)[3:, 0] = 0
    with pytest.raises(RaptorError, match="length zero"):
        objective(random_state, network, walls, 0.5)
