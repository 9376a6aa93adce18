"""CONDOR: force-dipole cells on a face-centred-cubic spring network in a tethered mould."""
