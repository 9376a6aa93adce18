"""Fitting cell and matrix parameters to tissues: least squares, posteriors, outlines (docs/fits.md)."""

from raptor.fitting.experimental_design import Sampled, rank_measurements, simulate_draws
from raptor.fitting.joint import fit_joint
from raptor.fitting.least_squares import Fit, Minimum, descend, minimise
from raptor.fitting.measurements import CANDIDATES, seen
from raptor.fitting.outline import Outline, deviations, distances, outline_measure, outline_of, read_outline
from raptor.fitting.posterior import Posterior, Survey, infer, profile, summarise, survey
from raptor.fitting.recovery import recover
from raptor.fitting.simulator import Simulator, descend_by_simulation, measure_again
from raptor.fitting.space_mapping import correct
from raptor.fitting.tables import tabulate, tabulate_joint, write_fit
from raptor.fitting.targets import (
    PARAMETERS,
    Target,
    parameters_at,
    surrogate_densities,
    surrogate_measure,
    unit_of,
)
from raptor.fitting.tissue import fit_tissue

__all__ = [
    "CANDIDATES",
    "PARAMETERS",
    "Fit",
    "Minimum",
    "Outline",
    "Posterior",
    "Sampled",
    "Simulator",
    "Survey",
    "Target",
    "correct",
    "descend",
    "descend_by_simulation",
    "deviations",
    "distances",
    "fit_joint",
    "fit_tissue",
    "infer",
    "measure_again",
    "minimise",
    "outline_measure",
    "outline_of",
    "parameters_at",
    "profile",
    "rank_measurements",
    "read_outline",
    "recover",
    "seen",
    "simulate_draws",
    "summarise",
    "surrogate_densities",
    "surrogate_measure",
    "survey",
    "tabulate",
    "tabulate_joint",
    "unit_of",
    "write_fit",
]
