"""What the surrogate predicts of many vectors or moulds: objectives and constraints of a search."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raptor.fields.resample import coarse_images
from raptor.moulds.cast import CastMould
from raptor.optimisation.casting import Candidate, decode
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
TOGETHER = 64  # moulds predicted at once, to bound memory
LARGEST_DISTANCE = 1.0  # to the training set, where the specification does not say


@dataclass(frozen=True)
class Judgement:
    """Vectors judged: smaller is better.

    Parameters
    ----------
    objectives : ndarray (n, objectives)
        With their signs, worsened by caution.
    violations : ndarray (n, 2 + constraints)
        Of the process, of the distance from the training set, then of each constraint; 0 or less where there
        is none.
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
        return decode(vector, self.spec, known.layers, known.pixels)

    def values(
        self, casts: Sequence[CastMould], samples: int | None = None
    ) -> dict[str, NDArray[np.float64]]:
        """Each measure (n, samples) by label, and `distance` and `held`, of n moulds."""
        count = samples or self.spec.search.samples
        values = {
            label: np.full((len(casts), count), np.nan) for label in (*self.spec.measured, "held", "distance")
        }
        for start in range(0, len(casts), TOGETHER):
            part = casts[start : start + TOGETHER]
            for number, (cast, found) in enumerate(
                zip(part, self._outcomes(part, count), strict=True), start
            ):
                for label, each in self._measured(cast, found).items():
                    values[label][number] = each
        return values

    def _outcomes(self, casts: Sequence[CastMould], count: int) -> NDArray[np.float32]:
        """Fields (n, count, 8, y', x') of moulds, per pixel of the networks' raster."""
        pixels = self.surrogate.architecture.pixels
        images, cells = zip(*((coarse_images(cast, pixels), cast.n_cells) for cast in casts), strict=True)
        found = outcomes(self.surrogate, np.stack(images), cells, self.spec.parameters, count)
        return found * np.float32((self.surrogate.pixels / pixels) ** 2)

    def _measured(self, cast: CastMould, found: NDArray[np.float32]) -> dict[str, list[float]]:
        """Each measure of a mould's outcomes (count, 8, y', x') by label, with `held` and `distance`."""
        view, unit = View(cast, found.shape[-1]), self.spec.unit
        values = {
            label: [measure(what, fields, view, self.factor, unit) for fields in found]
            for label, what in self.spec.measured.items()
            if what.measure not in ("held", "distance")
        }
        held = [float(all_held(fields, view, self.factor)) for fields in found]
        return values | {"held": held, "distance": len(found) * [self.distance(cast)]}

    @property
    def factor(self) -> float:
        """The threshold of one network's or sample's density over that of simulated density."""
        return self.surrogate.own_threshold / density_threshold(self.surrogate.layers, self.surrogate.pixels)

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
