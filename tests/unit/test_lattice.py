import numpy as np
import pytest
import shapely

from raptor.condor.lattice import build_lattice, connect, shell_offsets
from raptor.condor.network import build_network, build_sublattices
from raptor.moulds import Circle, Mould
from raptor.moulds.cast import cast_sites
from raptor.parameters import SHELL_DISTANCE, CellParameters, NetworkModel
from tests import naive

pytestmark = pytest.mark.one_processor


def test_reference_mould_has_the_cells_and_bonds_of_the_model():
    posts = tuple(Circle(x, y, 1.5) for x in (-21, 21) for y in (-8.5, 8.5))
    mould = Mould(shapely.box(-25, -12.5, 25, 12.5), posts)
    lattice = build_lattice(mould, CellParameters(0.5, 0.5, 0.3), NetworkModel(6))
    assert (lattice.cells, lattice.bonds) == (7083, 115666)


@pytest.mark.parametrize(("shell", "neighbours"), [(1, 12), (2, 6), (3, 24), (4, 12)])
def test_shells_have_the_neighbours_of_a_face_centred_cubic_lattice(shell, neighbours):
    offsets = shell_offsets(SHELL_DISTANCE[shell])
    assert 2 * len(offsets) == neighbours
    assert not {tuple(o) for o in offsets} & {tuple(-o) for o in offsets}


@pytest.mark.parametrize("shells", [(1, 2, 3), (1, 2, 4), (1, 3, 4)])
def test_bonds_are_those_found_by_trying_all_pairs(small_mould, parameters, shells):
    lattice = build_lattice(small_mould, parameters, NetworkModel(3, shells))
    kappas = dict(zip(shells, (1.0, parameters.kappa_nnn, parameters.kappa_nnnn), strict=True))
    shell_of = {SHELL_DISTANCE[s]: s for s in shells}
    found = {
        (min(i, j), max(i, j), shell_of[rest])
        for i, j, rest in zip(lattice.first, lattice.second, lattice.rest_length, strict=True)
    }
    assert len(found) == lattice.bonds
    assert found == naive.bonds(lattice.sites, {s: SHELL_DISTANCE[s] for s in shells})
    assert set(zip(lattice.rest_length, lattice.stiffness, strict=True)) == {
        (SHELL_DISTANCE[s], kappas[s]) for s in shells
    }


def test_sites_are_strictly_inside_and_outside_tethers(small_mould):
    sites = cast_sites(small_mould, 4)
    points = shapely.points(sites[:, :2])
    assert small_mould.outline.contains(points).all()
    assert np.hypot(sites[:, 0] - 2.0, sites[:, 1] - 0.5).min() > 1.1
    on_the_edge = Mould(shapely.box(-2, -2, 2, 2))
    assert np.abs(cast_sites(on_the_edge, 1)[:, :2]).max() == 1


def test_sites_have_the_full_square_symmetry():
    from raptor.symmetry import Element

    sites = cast_sites(Mould(shapely.box(-4.3, -4.3, 4.3, 4.3)), 3)
    wanted = {tuple(site) for site in sites.round(9)}
    for element in Element.all():
        moved = sites.copy()
        moved[:, :2] = sites[:, :2] @ element.matrix.T
        assert {tuple(site) for site in (moved + 0.0).round(9)} == wanted


def test_bonds_can_be_built_again_from_stored_sites(lattice, parameters, model):
    again = connect(lattice.sites.astype(np.float32).astype(float), parameters, model)
    assert np.array_equal(again.first, lattice.first)
    assert np.array_equal(again.second, lattice.second)


def bonds_of(network):
    """Each lane of a layout that holds a bond: first cell, second cell, stiffness, rest, direction."""
    for chunk in range(len(network.first)):
        for entry in range(network.entries[chunk], network.entries[chunk + 1]):
            kind = network.kind[entry]
            for lane in range(network.filled[chunk]):
                if network.bits[entry] >> lane & 1:
                    yield (
                        network.first[chunk] + lane,
                        network.second[entry] + lane,
                        network.stiffness[kind],
                        network.rest_length[kind],
                        network.direction[kind],
                    )


@pytest.mark.parametrize("precision", [np.float64, np.float32])
def test_the_layout_holds_every_bond_once(lattice, precision):
    found = list(bonds_of(build_network(lattice, precision)))
    wanted = {
        (i, j): values
        for i, j, *values in zip(
            lattice.first, lattice.second, lattice.stiffness, lattice.rest_length, strict=True
        )
    }
    assert len(found) == lattice.bonds
    assert {(i, j) for i, j, *_ in found} == set(wanted)
    for i, j, stiffness, rest, direction in found:
        assert (stiffness, rest) == pytest.approx(wanted[i, j])
        assert direction == pytest.approx((lattice.sites[j] - lattice.sites[i]) / rest, abs=1e-6)


@pytest.mark.parametrize("shells", [(1, 2, 3), (1, 2, 4), (1, 3, 4)])
def test_sublattices_hold_every_bond_from_both_ends_and_none_within_a_chunk(small_mould, parameters, shells):
    lattice = build_lattice(small_mould, parameters, NetworkModel(3, shells))
    order, network = build_sublattices(lattice)
    assert np.array_equal(np.sort(order), np.arange(lattice.cells))
    found = {(order[i], order[j]) for i, j, *_ in bonds_of(network)}
    wanted = set(zip(lattice.first, lattice.second, strict=True))
    assert found == wanted | {(j, i) for i, j in wanted}
    chunk = np.repeat(np.arange(len(network.first)), network.filled)
    assert all(chunk[i] != chunk[j] for i, j, *_ in bonds_of(network))
