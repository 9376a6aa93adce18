"""Several tissues of one kind fitted together, with common parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raptor.fitting.least_squares import STARTS, Minimum, Residuals, minimise
from raptor.fitting.simulator import descend_by_simulation
from raptor.fitting.targets import RATIOS, Measure, Target
from raptor.parameters import CellParameters


def fit_joint(
    targets: Mapping[str, Target],
    predicted: Sequence[Measure],
    refined: Sequence[Measure],
    simulated: Sequence[Measure],
    *,
    seed: int,
    budget: int,
    starts: int = STARTS,
) -> dict[str, Any]:
    """Fit tissues with common parameters by the surrogate, and continue by the simulator; returns JSON.

    Parameters
    ----------
    predicted, refined, simulated : sequence of Measure
        Of each tissue, in the order of the targets: by the surrogate, coarse and fine, and by simulation.
    budget : int
        Points at which all tissues may be simulated; 0: no fit by the simulator.
    """
    residuals = joint_residuals(list(targets.values()))
    fine = joint_measure(refined)
    found = minimise(joint_measure(predicted), residuals, starts=starts, seed=seed, fine=fine)
    content: dict[str, Any] = {
        "targets": {name: asdict(target) for name, target in targets.items()},
        "surrogate": _content(found, targets),
        "simulator": None,
    }
    if budget:
        found = descend_by_simulation(joint_measure(simulated), residuals, found.unit, budget)
        content["simulator"] = _content(found, targets)
    return content


def joint_measure(measures: Sequence[Measure]) -> Measure:
    """Area and width ratios of several tissues with common parameters, (n, 2 tissues)."""

    def measure(parameters: Sequence[CellParameters]) -> NDArray[np.float64]:
        return np.concatenate([each(parameters) for each in measures], axis=1)

    return measure


def joint_residuals(targets: Sequence[Target]) -> Residuals:
    """Residuals of several tissues, of the values of `joint_measure`."""

    def residuals(measured: NDArray[np.float64]) -> NDArray[np.float64]:
        parts = np.split(measured, len(targets), axis=-1)
        found = [target.residuals(part) for target, part in zip(targets, parts, strict=True)]
        return np.concatenate(found, axis=-1)

    return residuals


def _content(found: Minimum, targets: Mapping[str, Target]) -> dict[str, Any]:
    """A joint fit as JSON: common parameters, and each tissue's ratios and rss."""
    parts = found.measured.reshape(len(targets), 2)
    tissues = {
        name: dict(zip(RATIOS, map(float, part), strict=True)) | {"rss": target.rss(part)}
        for (name, target), part in zip(targets.items(), parts, strict=True)
    }
    return {
        "parameters": asdict(found.parameters),
        "rss": found.rss,
        "rank": found.rank,
        "evaluations": found.evaluations,
        "tissues": tissues,
    }
