import numpy as np
import pytest
import shapely

from raptor.condor import annealed, simulate
from raptor.condor.anneal import anneal
from raptor.condor.energy import objective
from raptor.condor.lattice import build_lattice
from raptor.condor.minimise import minimise
from raptor.condor.network import build_network, build_sublattices
from raptor.condor.system import cast_state
from raptor.condor.walls import build_walls
from raptor.errors import RaptorError
from raptor.moulds import Circle, Mould
from raptor.parameters import CellParameters, NetworkModel

POSTS = tuple(Circle(x, y, 1.0) for x in (-6.5, 6.5) for y in (-2.5, 2.5))
POSTED = Mould(shapely.box(-9, -5, 9, 5), POSTS, name="posted")
SOFT = CellParameters(0.9, 0.1, 0.01)
MIDDLE = CellParameters(0.5, 0.5, 0.3)


def assert_sound(tissue):
    for array in (tissue.positions, tissue.orientation, tissue.tension):
        assert np.isfinite(array).all()
    assert np.isfinite([tissue.energy, tissue.wall_energy, tissue.folded_fraction]).all()
    assert np.linalg.norm(tissue.orientation, axis=1) == pytest.approx(1)


@pytest.mark.parametrize("accuracy", ["draft", "standard", "reference"])
def test_every_level_converges_on_an_easy_mould_and_says_so(accuracy):
    tissue = simulate(POSTED, MIDDLE, NetworkModel(2), accuracy, 1)
    assert_sound(tissue)
    assert tissue.converged
    assert accuracy == "draft" or tissue.folded_fraction == 0
    assert POSTED.forbidden_depth(tissue.positions[:, :2]).max() < 0.1


def test_more_accurate_levels_end_lower():
    energies = [
        np.mean([simulate(POSTED, MIDDLE, NetworkModel(2), a, seed).energy for seed in range(4)])
        for a in (annealed(50), "draft", "reference")
    ]
    assert energies[0] > energies[1] > energies[2] * 0.999


def test_the_soft_corner_does_not_fold_at_standard():
    tissue = simulate(POSTED, SOFT, NetworkModel(3), "standard", 1)
    assert_sound(tissue)
    assert tissue.folded_fraction <= 1e-3


@pytest.mark.parametrize("delta", [0.0, 0.05, 0.95])
@pytest.mark.parametrize("kappas", [(0.1, 0.01), (0.0, 0.0), (0.71, 0.5)])
def test_corners_of_the_parameters(delta, kappas):
    tissue = simulate(POSTED, CellParameters(delta, *kappas), NetworkModel(1), "standard", 2)
    assert_sound(tissue)
    if delta == 0:
        assert tissue.energy == pytest.approx(0, abs=1e-9)
        assert tissue.positions == pytest.approx(tissue.sites)


@pytest.mark.parametrize(
    ("outline", "tethers", "cells"),
    [
        (shapely.box(-0.4, -0.4, 0.4, 0.4), (), 1),
        (shapely.box(-4.4, -0.4, 4.4, 0.4), (), 9),
        (shapely.box(-6, -3, 6, 3), tuple(Circle(0, y, 1.0) for y in (-1.9, 0, 1.9)), None),
    ],
    ids=["one cell", "one row", "cut in two by tethers"],
)
def test_odd_moulds(outline, tethers, cells):
    tissue = simulate(Mould(outline, tethers), SOFT, NetworkModel(1), "standard", 0)
    assert_sound(tissue)
    assert cells is None or tissue.cells == cells


def test_a_single_row_shrinks_to_its_natural_length():
    # Cells of a free row may all stand across it: every bond rests at 1 - Delta, or they lie along
    # it and it keeps its length; both have no energy, so only the energy is known.
    row = Mould(shapely.box(-4.4, -0.4, 4.4, 0.4))
    assert simulate(row, CellParameters(0.3, 0, 0), NetworkModel(1), "reference", 0).energy < 1e-4


def test_same_seed_same_tissue_and_another_seed_another():
    a, b, c = (simulate(POSTED, MIDDLE, NetworkModel(2), "reference", seed) for seed in (5, 5, 6))
    assert np.array_equal(a.positions, b.positions)
    assert not np.array_equal(a.positions, c.positions)


def test_minimisation_never_raises_the_objective():
    lattice = build_lattice(POSTED, SOFT, NetworkModel(2))
    network, walls = build_network(lattice), build_walls(POSTED, lattice.height)
    state = cast_state(lattice, np.random.default_rng(0))
    before = np.inf
    for limit in (5, 20, 80, 320, 1280):
        found = minimise(state, network, walls, 0.9, tolerance=0.0, limit=limit)
        total = found.energy + found.walled
        assert total <= before
        assert sum(objective(found.state, network, walls, 0.9)[:2]) == pytest.approx(total)
        assert not found.converged
        before = total


def test_metropolis_samples_boltzmanns_distribution():
    """Length of one bond at a constant temperature: p(r) ~ r^2 exp(-(r - 1)^2 / 2T)."""
    pair = Mould(shapely.box(-10, -10, 10, 10))
    parameters, model = CellParameters(0.0, 0, 0), NetworkModel(8)
    walls = build_walls(pair, model.height)
    lattice = build_lattice(Mould(shapely.box(-0.4, -0.4, 1.4, 0.4)), parameters, NetworkModel(1))
    order, network = build_sublattices(lattice)
    state = cast_state(lattice, np.random.default_rng(0)).reshape(6, -1)
    state[2] += 2.0  # away from floor and fill height
    temperature, rng, lengths = 0.02, np.random.default_rng(1), []
    state = state.ravel()
    for _ in range(4000):
        state = anneal(
            state, order, network, walls, 0.0, rng,
            sweeps=20, initial_temperature=temperature, temperature_factor=1.0,
        ).state  # fmt: skip
        positions = state.reshape(6, -1)[:3]
        state.reshape(6, -1)[:3] -= positions.mean(axis=1, keepdims=True) - [[0.0], [0.0], [2.5]]
        lengths.append(np.linalg.norm(positions[:, 1] - positions[:, 0]))
    r = np.linspace(1e-3, 3, 20001)
    weight = r**2 * np.exp(-((r - 1) ** 2) / (2 * temperature))
    mean = (r * weight).sum() / weight.sum()
    spread = np.sqrt((r**2 * weight).sum() / weight.sum() - mean**2)
    # Successive samples are correlated: allow for one independent sample in four.
    assert np.mean(lengths) == pytest.approx(mean, abs=4 * spread / np.sqrt(len(lengths) / 4))
    assert np.std(lengths) == pytest.approx(spread, rel=0.1)


def test_senseless_requests_are_named():
    with pytest.raises(RaptorError, match="accuracy is 'perfect'"):
        simulate(POSTED, MIDDLE, NetworkModel(1), "perfect")
    with pytest.raises(RaptorError, match="at least 1 sweep"):
        anneal(np.ones(6), None, None, None, 0.5, np.random.default_rng(0), sweeps=0)
    with pytest.raises(RaptorError, match="holds no cell"):
        simulate(Mould(shapely.box(0.1, 0.1, 0.3, 0.3), name="tiny"), MIDDLE, NetworkModel(1))
