"""Gels without tethers, whose contraction is known."""

import numpy as np
import pytest
import shapely
from scipy.optimize import brentq, minimize

from raptor.condor.energy import objective
from raptor.condor.lattice import build_lattice
from raptor.condor.network import build_network
from raptor.condor.simulate import simulate
from raptor.condor.walls import NO_WALLS
from raptor.moulds import Mould
from raptor.parameters import CellParameters, NetworkModel

GEL = Mould(shapely.box(-5.2, -4.2, 5.2, 4.2), name="gel")
SMALL = Mould(shapely.box(-3.2, -2.2, 3.2, 2.2), name="small gel")


def contracted(parameters, layers, orientation):
    """Cast and final positions (cells, 3) of a small free gel whose orientations are prescribed."""
    lattice = build_lattice(SMALL, parameters, NetworkModel(layers))
    network = build_network(lattice)
    held = np.repeat(np.array(orientation, dtype=float), lattice.cells)

    def energy(positions, delta):
        state = np.concatenate([positions, held])
        value, _, gradient = objective(state, network, NO_WALLS, delta)
        return value, gradient[: len(positions)]

    positions = lattice.sites.T.ravel()
    options = {"maxiter": 5000, "ftol": 1e-16, "gtol": 1e-10}
    for delta in np.linspace(0, parameters.delta, 8)[1:]:  # follow it: at once it turns inside out
        found = minimize(energy, positions, (delta,), "L-BFGS-B", jac=True, options=options)
        positions = found.x
    assert found.fun < 1e-10  # every bond is at rest: the analytic state has no energy
    return lattice.sites, positions.reshape(3, -1).T


def stretches(before, after):
    """Principal stretches of the best linear map, and how far it is from a pure stretch."""
    before, after = (points - points.mean(axis=0) for points in (before, after))
    if np.ptp(before[:, 2]) == 0:
        before, after = before[:, :2], after[:, :2]
    gradient = np.linalg.lstsq(before, after, rcond=None)[0].T
    return np.diag(gradient), gradient - np.diag(np.diag(gradient))


@pytest.mark.parametrize("delta", [0.05, 0.5, 0.8])
def test_one_layer_with_upright_cells_shrinks_by_one_minus_delta(delta):
    # Every bond is perpendicular to both its cells and rests at L (1 - Delta), in all shells.
    found, turned = stretches(*contracted(CellParameters(delta, 0.5, 0.3), 1, (0, 0, 1)))
    assert found == pytest.approx(1 - delta, abs=1e-5)
    assert turned == pytest.approx(0, abs=1e-5)


def test_one_layer_with_cells_along_x_shrinks_along_y_alone():
    found, _ = stretches(*contracted(CellParameters(0.4, 0, 0), 1, (1, 0, 0)))
    assert found == pytest.approx([1.0, 0.6], abs=1e-4)


def test_nearest_neighbours_with_upright_cells_take_the_analytic_height():
    # In the plane 1 - Delta; an inclined bond of length r makes r^3 - r^2 + Delta w^2 / 2 = 0.
    delta = 0.3
    wide = 1 - delta
    inclined = brentq(lambda r: r**3 - r**2 + delta * wide**2 / 2, 0.75, 1.0)
    high = np.sqrt(2 * inclined**2 - wide**2)
    found, _ = stretches(*contracted(CellParameters(delta, 0, 0), 4, (0, 0, 1)))
    assert found == pytest.approx([wide, wide, high], abs=1e-4)


@pytest.mark.parametrize("layers", [1, 4])
def test_a_free_gel_neither_drifts_nor_turns(layers):
    tissue = simulate(GEL, CellParameters(0.6, 0.4, 0.2), NetworkModel(layers), "standard", 3)
    before, after = tissue.sites[:, :2], tissue.positions[:, :2]
    assert before.mean(axis=0) == pytest.approx(0, abs=1e-9)
    assert after.mean(axis=0) == pytest.approx(before.mean(axis=0), abs=1e-6)
    cross = after.T @ before  # the best rigid turn (Kabsch)
    assert np.arctan2(cross[1, 0] - cross[0, 1], np.trace(cross)) == pytest.approx(0, abs=1e-3)
    assert np.ptp(after[:, 0]) < 0.95 * np.ptp(before[:, 0])


def test_turned_gels_contract_alike():
    """D4 images of a gel differ by no more than seeds do."""
    parameters, model = CellParameters(0.6, 0.4, 0.2), NetworkModel(2)
    turned = GEL.transformed(np.array([[0.0, -1.0], [1.0, 0.0]]))
    spreads = [
        [np.std(simulate(m, parameters, model, "standard", seed).positions[:, axis]) for seed in range(6)]
        for m, axis in ((GEL, 0), (turned, 1))
    ]
    scatter = np.hypot(*(np.std(s, ddof=1) for s in spreads))
    assert abs(np.mean(spreads[0]) - np.mean(spreads[1])) < 3 * scatter
