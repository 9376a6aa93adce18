"""RAPTOR: rapid prediction of tissue organisation.

CONDOR, a model of force-dipole cells on a face-centred-cubic spring network, simulates how a
cell-laden hydrogel contracts in a tethered mould; networks trained on thousands of such
simulations predict the same fields in a fraction of a second.

    import raptor

    mould = raptor.read_mould("mould.svg")
    cells = raptor.CellParameters(delta=0.5, kappa_nnn=0.5, kappa_nnnn=0.3)
    tissue = raptor.simulate(mould, cells)
    prediction = raptor.predict(mould, cells)
    raptor.plot(tissue).savefig("tissue.png")

See `docs/python.md`. Names are those of `__init__.pyi`; each is imported on first use.

Source of the methods: A. E. Andrews et al., "Rapid prediction of organisation in engineered
corneal, glial and fibroblast tissues using machine learning and biophysical models" (2025).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
