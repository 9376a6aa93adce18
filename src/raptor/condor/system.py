"""A cast mould, prepared for the solvers."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import DTypeLike, NDArray

from raptor.condor.lattice import Lattice, build_lattice
from raptor.condor.network import Network, build_network, build_sublattices
from raptor.condor.walls import Walls, build_walls
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters, NetworkModel


@dataclass(frozen=True)
class System:
    """Lattice, its bonds in the layouts of minimisers and of trial moves, and the mould's walls."""

    lattice: Lattice
    network: Network
    order: NDArray[np.int64]
    sublattices: Network
    walls: Walls


def build_system(
    mould: Mould, parameters: CellParameters, model: NetworkModel, precision: DTypeLike = np.float64
) -> System:
    """Cast a mould and prepare it for states of float64 or float32.

    Raises
    ------
    RaptorError
        If the mould holds no cell.
    """
    lattice = build_lattice(mould, parameters, model)
    walls = build_walls(mould, model.height)
    return System(lattice, build_network(lattice, precision), *build_sublattices(lattice, precision), walls)


def cast_state(sites: NDArray[np.float64], rng: Generator) -> NDArray[np.float64]:
    """The state (6 * cells,) at casting: cells on sites (cells, 3), orientations uniform on the sphere."""
    orientation = rng.normal(size=(3, len(sites)))
    orientation /= np.linalg.norm(orientation, axis=0)
    return np.concatenate([sites.T.ravel(), orientation.ravel()])
