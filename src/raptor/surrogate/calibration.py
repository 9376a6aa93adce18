"""Learning on the validation split how errors follow from the spread of networks."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from raptor.core.errors import RaptorError
from raptor.dataset.stack import Sample, read_samples, read_table
from raptor.fields.metrics import without_sign
from raptor.fields.shape import shape_ratios
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.raster import density_threshold
from raptor.surrogate.bands import USUAL, Calibration, fit_scale, relative_spread
from raptor.surrogate.inference import Surrogate, deviation
from raptor.surrogate.out_of_distribution import Novelty, descriptors

EDGES = (0.8, 1.25)  # between which the edge of predicted tissues is sought
PIXELS = 400  # of each sample, chosen at random within the depression


def calibrate(
    surrogate: Surrogate,
    stack: Path,
    moulds: Mapping[str, Mould],
    seed: int,
    on_progress: Callable[[int], None] = lambda simulation: None,
) -> Calibration:
    """The calibration of a surrogate on a stack's validation split.

    Raises
    ------
    RaptorError
        Where the stack has no validation sample.
    """
    table, threshold = read_table(stack), density_threshold(surrogate.layers, surrogate.pixels)
    rows = table.rows("validation")
    if not rows:
        raise RaptorError(f"{stack} has no validation sample; raise design.validation")
    points = np.stack([_descriptors(sample) for sample in read_samples(stack, table.rows("train"))])
    novelty = Novelty(points.astype(np.float32))
    fields: list[NDArray[np.floating]] = []
    seen: list[Silhouette] = []
    disagreements, distances = [], []
    for sample in read_samples(stack, rows):
        cast = surrogate.cast(moulds[sample.mould])
        predicted, spread, of_members = surrogate.ensemble(cast, sample.parameters)
        rng = np.random.default_rng([seed, sample.simulation])
        inside = np.flatnonzero(cast.depression)
        chosen = rng.choice(inside, PIXELS, replace=len(inside) < PIXELS)
        error, wide, size = (
            part.reshape(len(part), -1)[:, chosen].T
            for part in (without_sign(predicted) - without_sign(sample.fields), spread, np.abs(predicted[:1]))
        )
        fields.append(np.stack([error, wide, np.broadcast_to(size, error.shape)]))
        true = shape_ratios(sample.fields[0], cast)
        seen.append(Silhouette(cast, true, predicted[0], of_members))
        disagreements.append(relative_spread(spread, predicted))
        distances.append(novelty.distance(_descriptors(sample)))
        on_progress(sample.simulation)
    edge = fit_edge(seen, threshold)
    shapes = [each.errors(edge * threshold) for each in seen]
    return Calibration(
        fit_scale(*np.concatenate(fields, axis=1)),
        fit_scale(*np.stack(shapes, axis=1)),
        float(np.quantile(disagreements, USUAL)),
        Novelty(novelty.points, float(np.quantile(distances, USUAL))),
        edge,
    )


@dataclass(frozen=True)
class Silhouette:
    """A tissue's true ratios (2,), and densities predicted by all networks (y, x) and by each (n, y, x)."""

    cast: CastMould
    true: NDArray[np.float64]
    predicted: NDArray[np.float32]
    of_members: NDArray[np.float32]

    def error(self, threshold: float) -> NDArray[np.float64]:
        """Errors of A/A0 and w/w0, (2,), where tissue is what is above a threshold."""
        return shape_ratios(self.predicted, self.cast, threshold) - self.true

    def errors(self, threshold: float) -> NDArray[np.float64]:
        """Errors, spread over networks and sizes of both ratios, (3, 2)."""
        of_each = [shape_ratios(d, self.cast, threshold) for d in self.of_members]
        return np.stack([self.error(threshold), deviation(np.array(of_each)), np.ones(2)])


def fit_edge(seen: Sequence[Silhouette], threshold: float) -> float:
    """The factor of the threshold at which A/A0 and w/w0 err least, by their mean absolute error.

    Networks soften what they are not sure of: the contour of the simulated tissue's density lies outside
    of the tissue in a softer image, and a higher one where the tissue ends.
    """

    def cost(edge: float) -> float:
        return float(np.nanmean([np.abs(each.error(edge * threshold)) for each in seen]))

    return float(minimize_scalar(cost, bounds=EDGES, method="bounded", options={"xatol": 1e-3}).x)


def _descriptors(sample: Sample) -> NDArray[np.float64]:
    return descriptors(sample.depression, sample.tethers, sample.parameters)
