"""What the surrogate predicts of many vectors or moulds: objectives and constraints of a search."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raptor.moulds.cast import CastMould
from raptor.optimisation.casting import Candidate, count_cells, decode, masks
from raptor.optimisation.measures import View, all_held, measure
from raptor.optimisation.spec import DesignSpec
from raptor.raster import density_threshold
from raptor.surrogate.inference import Surrogate
from raptor.surrogate.out_of_distribution import descriptors
from raptor.surrogate.screening import outcomes

WORST = 1e3
"""Objective of a vector without a mould."""
UNMEASURED = 10.0
"""Violation of a constraint that could not be measured: larger than any that could."""
LARGEST_DISTANCE = 1.0  # to the training set, where the specification does not say


@dataclass(frozen=True)
class Judgement:
    """Vectors judged: smaller is better.

    Parameters
    ----------
    objectives : ndarray (n, objectives)
        With their signs, worsened by caution.
    violations : ndarray (n, 1 + constraints)
        Of the process, then of each constraint; 0 or less where there is none.
    """

    objectives: NDArray[np.float64]
    violations: NDArray[np.float64]


@dataclass(frozen=True)
class Evaluator:
    """Judges vectors by a surrogate, as a specification says."""

    spec: DesignSpec
    surrogate: Surrogate

    def judge(self, vectors: NDArray[np.float64]) -> Judgement:
        """Objectives and violations of vectors (n, GENES)."""
        candidates = [self.decode(vector) for vector in vectors]
        made = [number for number, each in enumerate(candidates) if each.cast is not None]
        constraints = self.spec.constraints
        objectives = np.full((len(vectors), len(self.spec.objectives)), WORST)
        violations = np.full((len(vectors), 2 + len(constraints)), UNMEASURED)
        violations[:, 0] = [each.violation for each in candidates]
        if made:
            values = self.values([each.cast for each in candidates if each.cast is not None])
            objectives[made], violations[made, 1:] = self._judged(values)
        return Judgement(objectives, violations)

    def decode(self, vector: NDArray[np.float64]) -> Candidate:
        """The mould of a vector, or its violation."""
        known = self.surrogate
        return decode(vector, self.spec, known.layers, known.pixels, known.clearance)

    def values(
        self, casts: Sequence[CastMould], samples: int | None = None
    ) -> dict[str, NDArray[np.float64]]:
        """Each measure (n, samples) by label, and `distance` and `held`, of n moulds."""
        spec, surrogate = self.spec, self.surrogate
        count, pixels = samples or spec.search.samples, surrogate.architecture.pixels
        images = np.stack([masks(cast, pixels) for cast in casts])
        found = outcomes(surrogate, images, [count_cells(cast) for cast in casts], spec.parameters, count)
        labels = [*spec.measured, "held", "distance"]
        values = {label: np.full((len(casts), count), np.nan) for label in labels}
        for number, (cast, samples_of) in enumerate(zip(casts, found, strict=True)):
            values["distance"][number] = self.distance(cast)
            view = View(cast, pixels)
            for sample, fields in enumerate(samples_of):
                whole = fields * (surrogate.pixels / pixels) ** 2
                for label, what in spec.measured.items():
                    if what.measure not in ("held", "distance"):
                        values[label][number, sample] = measure(what, whole, view, self.factor, spec.unit)
                values["held"][number, sample] = all_held(whole, view, self.factor)
        return values

    @property
    def factor(self) -> float:
        """The threshold of predicted density over that of simulated density."""
        return self.surrogate.threshold / density_threshold(self.surrogate.layers, self.surrogate.pixels)

    def distance(self, cast: CastMould) -> float:
        """From mould and cells to the nearest of the training set, over the usual distance; 0 if unknown."""
        if self.surrogate.calibration is None:
            return 0.0
        point = descriptors(cast.depression, cast.tethers, self.spec.parameters)
        return self.surrogate.calibration.training.distance(point)

    def _judged(
        self, values: dict[str, NDArray[np.float64]]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Objectives (n, objectives) and violations (n, 1 + constraints), distance first."""
        caution = self.spec.search.caution
        objectives = [
            each.sign * values[each.label].mean(axis=1) + caution * values[each.label].std(axis=1)
            for each in self.spec.objectives
        ]
        beyond = [values["distance"][:, 0] - self.farthest]
        for each in self.spec.constraints:
            mean = values[each.label].mean(axis=1)
            over = np.full(len(mean), -np.inf)
            for limit, sign in ((each.at_most, 1), (each.at_least, -1)):
                if limit is not None:
                    over = np.maximum(over, sign * (mean - limit) / max(abs(limit), 1e-3))
            beyond.append(over)
        found = np.nan_to_num(np.column_stack(objectives), nan=WORST)
        return found, np.nan_to_num(np.column_stack(beyond), nan=UNMEASURED)

    @property
    def farthest(self) -> float:
        """The largest distance from the training set that is allowed."""
        limits = [each.at_most for each in self.spec.constraints if each.measure == "distance"]
        return max([limit for limit in limits if limit is not None], default=LARGEST_DISTANCE)
