"""CONDOR: force-dipole cells on a face-centred-cubic spring network in a tethered mould."""

from raptor.condor.lattice import Lattice, build_lattice, cast_sites, connect
from raptor.condor.simulate import Accuracy, Simulation, accuracy_named, annealed, simulate

__all__ = [
    "Accuracy",
    "Lattice",
    "Simulation",
    "accuracy_named",
    "annealed",
    "build_lattice",
    "cast_sites",
    "connect",
    "simulate",
]
