import numpy as np
import pytest
import shapely

from raptor.condor.accuracy import ACCURACIES, Accuracy, accuracy_named, annealed
from raptor.condor.anneal import anneal
from raptor.condor.contract import (
    CONTACT,
    COOLING,
    FEWEST_STEPS,
    Contraction,
    agitation_temperature,
    contract,
    refine,
    steps_to,
)
from raptor.condor.energy import objective
from raptor.condor.lattice import build_lattice
from raptor.condor.minimise import minimise
from raptor.condor.network import build_network, build_sublattices
from raptor.condor.simulate import simulate
from raptor.condor.system import build_system, cast_state
from raptor.condor.walls import NO_WALLS, build_walls
from raptor.core.errors import RaptorError
from raptor.moulds import Circle, Mould
from raptor.parameters import CellParameters, NetworkModel
from raptor.symmetry import Element

POSTS = tuple(Circle(x, y, 1.0) for x in (-6.5, 6.5) for y in (-2.5, 2.5))
POSTED = Mould(shapely.box(-9, -5, 9, 5), POSTS, name="posted")
SOFT = CellParameters(0.9, 0.1, 0.01)
MIDDLE = CellParameters(0.5, 0.5, 0.3)


def assert_sound(tissue):
    for array in (tissue.positions, tissue.orientation, tissue.tension):
        assert np.isfinite(array).all()
    assert np.isfinite([tissue.energy, tissue.wall_energy, tissue.inverted_fraction]).all()
    assert np.linalg.norm(tissue.orientation, axis=1) == pytest.approx(1)


@pytest.mark.parametrize("accuracy", ["draft", "standard", "reference"])
def test_every_level_converges_on_an_easy_mould_and_says_so(accuracy):
    tissue = simulate(POSTED, MIDDLE, NetworkModel(2), accuracy, 1)
    assert_sound(tissue)
    assert tissue.converged
    assert tissue.inverted_fraction == 0
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
    assert tissue.inverted_fraction == 0


@pytest.mark.parametrize("layers", [1, 2, 3])
@pytest.mark.parametrize("delta", [0.0, 0.05, 0.5, 0.95])
@pytest.mark.parametrize("kappas", [(0.1, 0.01), (0.1, 0.07), (0.71, 0.01), (0.71, 0.5), (0.0, 0.0)])
def test_corners_and_edges_of_the_parameters(delta, kappas, layers):
    """No NaN, nothing folds, and the network is no worse than where it was cast."""
    parameters, model = CellParameters(delta, *kappas), NetworkModel(layers)
    tissue = simulate(POSTED, parameters, model, "standard", 2)
    assert_sound(tissue)
    assert tissue.inverted_fraction == 0
    assert tissue.converged
    system = build_system(POSTED, parameters, model)
    cast = cast_state(system.lattice.sites, np.random.default_rng(2))
    before = objective(cast, system.network, NO_WALLS, delta)[0]
    assert tissue.energy + tissue.wall_energy <= 0.5 * before + 1e-9
    if delta == 0:
        assert tissue.energy == pytest.approx(0, abs=1e-9)
        assert tissue.positions == pytest.approx(tissue.sites)


def test_a_run_that_cannot_converge_says_so():
    hasty = Accuracy("contract", Contraction(0.3, 5, 5e-3, 5e-3, 1e-9, 30, 30))
    tissue = simulate(POSTED, SOFT, NetworkModel(2), hasty, 0)
    assert_sound(tissue)
    assert not tissue.converged
    assert not simulate(
        Mould(shapely.box(-0.4, -0.4, 0.4, 0.4)), SOFT, NetworkModel(1), "anneal-10"
    ).converged


def test_what_is_said_to_be_left_of_the_gradient_is_left():
    """Of bonds, walls and contacts, at unit orientations; also where contacts are held."""
    held, dense = 0.0, CellParameters(0.95, 0.71, 0.5)
    for seed in range(3):
        tissue = simulate(POSTED, dense, NetworkModel(3), "standard", seed)
        system = build_system(POSTED, dense, NetworkModel(3))
        state = np.concatenate([tissue.positions.T.ravel(), tissue.orientation.T.ravel()])
        contact = CONTACT if tissue.contact_energy > 0 else 0.0
        _, wall_energy, gradient = objective(state, system.network, system.walls, dense.delta, contact)
        gradient[gradient.size // 2 :] /= dense.delta
        assert np.abs(gradient).max() == pytest.approx(tissue.residual_gradient, rel=1e-3)
        assert wall_energy == pytest.approx(tissue.wall_energy + tissue.contact_energy, rel=1e-6, abs=1e-9)
        assert tissue.residual_gradient <= ACCURACIES["standard"].contraction.tolerance * dense.delta
        held += tissue.contact_energy
    assert held > 0  # this corner does need them


@pytest.mark.parametrize("delta", [0.05, 0.5, 0.9])
def test_agitation_moves_cells_from_its_first_sweeps(delta):
    """Proposals start at about the thermal amplitude, not so large that all are refused."""
    system = build_system(POSTED, MIDDLE, NetworkModel(2))
    state = cast_state(system.lattice.sites, np.random.default_rng(0))
    state = minimise(state, system.network, system.walls, delta, tolerance=1e-2, max_evaluations=500).state
    for sweeps in (5, 50):
        found = anneal(
            state, system.order, system.sublattices, system.walls, delta, np.random.default_rng(1),
            sweeps=sweeps, initial_temperature=agitation_temperature(delta), temperature_factor=COOLING,
        )  # fmt: skip
        assert 0.1 < found.acceptance_rate < 0.7


def test_single_precision_agrees_within_the_spread_of_seeds():
    """Mean widths, heights and energies of several seeds, soft corner and middle."""
    for parameters in (MIDDLE, SOFT):
        found = {}
        for accuracy in ("standard", "standard-float32"):
            tissues = [simulate(POSTED, parameters, NetworkModel(2), accuracy, seed) for seed in range(8)]
            assert all(t.converged and t.inverted_fraction == 0 for t in tissues)
            found[accuracy] = np.array([[*t.positions.std(axis=0), t.energy] for t in tissues])
        double, single = found.values()
        spread = np.sqrt((double.var(axis=0, ddof=1) + single.var(axis=0, ddof=1)) / len(double))
        assert np.all(np.abs(double.mean(axis=0) - single.mean(axis=0)) < 4.5 * spread)


def test_turned_and_mirrored_moulds_give_turned_and_mirrored_tissues():
    """D4 images of a mould without symmetry differ by no more than seeds do."""
    mould = Mould(shapely.box(-8, -5, 7, 5), (Circle(-5, 2, 1.2), Circle(4, -2, 1.0)), name="skew")
    parameters, model, seeds = CellParameters(0.6, 0.4, 0.2), NetworkModel(2), range(6)
    cast = None
    means, variances = [], []
    for element in Element.all():
        image = mould.transformed(element.matrix)
        measures = []
        for seed in seeds:
            tissue = simulate(image, parameters, model, "standard", seed)
            back = tissue.positions[:, :2] @ element.matrix  # the inverse of a turn is its transpose
            measures.append([*back.mean(axis=0), *back.std(axis=0)])
        cast = tissue.cells if cast is None else cast
        assert tissue.cells == cast
        means.append(np.mean(measures, axis=0))
        variances.append(np.var(measures, axis=0, ddof=1))
    error = np.sqrt(np.mean(variances, axis=0) / len(seeds))
    assert np.all(np.abs(np.array(means) - np.mean(means, axis=0)) < 5 * error)


def test_steps_shorten_bonds_by_the_same_part():
    path = steps_to(0.9, 0.3)
    assert path[-1] == 0.9
    left = 1 - np.concatenate([[0], path])
    shortened = 1 - left[1:] / left[:-1]
    assert shortened == pytest.approx(shortened[0])
    assert shortened[0] <= 0.3
    assert len(steps_to(0.05, 0.3)) == FEWEST_STEPS  # an easy gel takes few
    assert len(path) > len(steps_to(0.5, 0.3)) >= FEWEST_STEPS
    assert steps_to(0.9, 1.0).tolist() == [0.9]


def test_agitation_neither_folds_nor_survives_without_contraction():
    assert agitation_temperature(0.0) == 0
    deltas = np.linspace(0.01, 0.99, 50)
    temperatures = np.array([agitation_temperature(delta) for delta in deltas])
    # Thermal motion of a cell held by some ten springs is well below the bonds' natural length.
    assert np.all(np.sqrt(temperatures / 10) < 0.2 * (1 - deltas))


def test_rounds_never_end_higher():
    system = build_system(POSTED, MIDDLE, NetworkModel(2))
    rng = np.random.default_rng(0)
    contraction = ACCURACIES["standard"].contraction
    state = cast_state(system.lattice.sites, rng)
    before = contract(state, system, MIDDLE.delta, contraction, rng)
    after = refine(before, system, MIDDLE.delta, contraction, rng, hops=3, sweeps=50)
    assert after.energy + after.wall_energy <= before.energy + before.wall_energy
    assert after.evaluations > before.evaluations


@pytest.mark.parametrize(
    ("name", "solver", "sweeps", "precision"),
    [
        ("standard", "contract", 0, "mixed"),
        ("standard-float32", "contract", 0, "float32"),
        ("reference", "contract", 0, "float64"),
        ("draft", "contract", 0, "float32"),
        ("anneal-1e3", "anneal", 1000, "float64"),
        ("anneal-250-minimised-float32", "anneal", 250, "float32"),
    ],
)
def test_accuracies_have_names(name, solver, sweeps, precision):
    accuracy = accuracy_named(name)
    assert (accuracy.solver, accuracy.anneal_sweeps, accuracy.precision) == (solver, sweeps, precision)


@pytest.mark.parametrize(
    "name",
    [
        "perfect",
        "anneal",
        "anneal-0",
        "anneal-1e3-minimized",
        "standard-",
        "draft-float32-float32",
        "anneal-1e3-float32-minimised",
        "standard-float32x",
        "anneal-9999999999",
    ],
)
def test_other_names_are_refused(name):
    with pytest.raises(RaptorError, match=f"accuracy is '{name}'; allowed are draft"):
        accuracy_named(name)


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
    state = cast_state(lattice.sites, np.random.default_rng(0))
    before = np.inf
    for limit in (5, 20, 80, 320, 1280):
        found = minimise(state, network, walls, 0.9, tolerance=0.0, max_evaluations=limit)
        total = found.energy + found.wall_energy
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
    state = cast_state(lattice.sites, np.random.default_rng(0)).reshape(6, -1)
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


def test_metropolis_samples_boltzmanns_distribution_of_orientations():
    """Two cells at Delta = 0.5: the mean of (u.s)^2 and of the length, against quadrature."""
    pair = Mould(shapely.box(-10, -10, 10, 10))
    delta, temperature = 0.5, 0.01
    lattice = build_lattice(
        Mould(shapely.box(-0.4, -0.4, 1.4, 0.4)), CellParameters(delta, 0, 0), NetworkModel(1)
    )
    order, network = build_sublattices(lattice)
    state, rng = cast_state(lattice.sites, np.random.default_rng(0)), np.random.default_rng(1)
    walls, along, lengths = build_walls(pair, 8.0), [], []
    for _ in range(6000):
        state = anneal(
            state, order, network, walls, delta, rng,
            sweeps=20, initial_temperature=temperature, temperature_factor=1.0,
        ).state  # fmt: skip
        blocks = state.reshape(6, -1)
        blocks[:3] -= blocks[:3].mean(axis=1, keepdims=True) - [[0.0], [0.0], [4.0]]
        displacement = blocks[:3, 1] - blocks[:3, 0]
        lengths.append(np.linalg.norm(displacement))
        along.append(((displacement / lengths[-1]) @ blocks[3:]) ** 2)
    c = np.linspace(0, 1, 81)  # |cos|, uniform for a uniform orientation
    r = np.linspace(1e-3, 2, 1001)[:, None, None]
    natural = 1 - delta / 2 * (2 - c[:, None] ** 2 - c[None, :] ** 2)
    weight = r**2 * np.exp(-((r - natural) ** 2) / (2 * temperature))
    weight[:, [0, -1]] *= 0.5
    weight[:, :, [0, -1]] *= 0.5
    squares = (weight * c[:, None] ** 2).sum() / weight.sum()
    length = (weight * r).sum() / weight.sum()
    blocks_of = np.array(along).mean(axis=1).reshape(60, -1).mean(axis=1)
    error = blocks_of.std(ddof=1) / np.sqrt(len(blocks_of))
    assert abs(blocks_of.mean() - squares) < 4 * error
    assert error < 0.02
    assert np.mean(lengths) == pytest.approx(length, abs=0.02)


def test_senseless_requests_are_named():
    with pytest.raises(RaptorError, match="accuracy is 'perfect'"):
        simulate(POSTED, MIDDLE, NetworkModel(1), "perfect")
    with pytest.raises(RaptorError, match="at least 1 sweep"):
        anneal(np.ones(6), None, None, None, 0.5, np.random.default_rng(0), sweeps=0)
    with pytest.raises(RaptorError, match="holds no cell"):
        simulate(Mould(shapely.box(0.1, 0.1, 0.3, 0.3), name="tiny"), MIDDLE, NetworkModel(1))
