"""CONDOR: force-dipole cells on a face-centred-cubic spring network in a tethered mould."""

from raptor.condor.accuracy import ACCURACIES, Accuracy, Simulation, annealed, simulate
from raptor.condor.lattice import Lattice, build_lattice, cast_sites, connect

__all__ = [
    "ACCURACIES",
    "Accuracy",
    "Lattice",
    "Simulation",
    "annealed",
    "build_lattice",
    "cast_sites",
    "connect",
    "simulate",
]
