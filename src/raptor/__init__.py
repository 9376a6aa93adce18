"""RAPTOR: rapid prediction of tissue organisation.

CONDOR, a model of force-dipole cells on a face-centred-cubic spring network, simulates how a
cell-laden hydrogel contracts in a tethered mould; networks trained on thousands of such
simulations predict the same fields in a fraction of a second.

Source of the methods: A. E. Andrews et al., "Rapid prediction of organisation in engineered
corneal, glial and fibroblast tissues using machine learning and biophysical models" (2025).
"""

from raptor.core.version import MODEL_VERSION, __version__

__all__ = ["MODEL_VERSION", "__version__"]
