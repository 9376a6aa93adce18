"""Calibration on the validation split: errors as a function of the disagreement of networks."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from raptor.core.errors import RaptorError
from raptor.dataset.examples import training_rows
from raptor.dataset.stack import Sample, read_samples, read_table
from raptor.fields.directors import alignment, anisotropy
from raptor.fields.metrics import without_sign
from raptor.fields.shape import shape_ratios
from raptor.moulds.geometry import Mould
from raptor.raster import density_threshold
from raptor.surrogate.bands import MEASURED, USUAL, Calibration, disagreement, fit_scale
from raptor.surrogate.ensemble import Ensemble, Realisations
from raptor.surrogate.inference import Surrogate
from raptor.surrogate.out_of_distribution import TrainingSet, descriptors

FACTORS = (0.8, 1.25)
"""Bounds of the factor of the threshold for predicted tissues."""

PIXELS = 400
"""Pixels of each sample, chosen at random within the depression."""


@dataclass(frozen=True)
class Case:
    """A validation sample and its prediction.

    Parameters
    ----------
    simulated : ndarray (4,)
        Simulated `bands.MEASURED`.
    found : Realisations
        Predicted.
    """

    simulated: NDArray[np.float64]
    found: Realisations

    def error_of_mean(self, threshold: float) -> NDArray[np.float64]:
        """Errors (4,) of the measures of the mean, for a threshold of tissue.

        A tissue torn on its section has no width.
        """
        return np.nan_to_num(self.found.of_mean(threshold)) - self.simulated

    def error(self, threshold: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Errors (4,) of the estimates, likewise, and deviations over realisations (4,)."""
        estimate, deviations, _ = self.found.measure(threshold)
        return np.nan_to_num(estimate) - self.simulated, deviations


def calibrate(
    surrogate: Surrogate,
    stacks: Mapping[Path, Mapping[str, Mould]],
    seed: int,
    fraction: float = 1.0,
    on_progress: Callable[[int], None] = lambda simulation: None,
) -> Calibration:
    """The calibration of a surrogate on the validation splits of the stacks that it was trained on.

    Parameters
    ----------
    stacks : mapping
        Moulds of each stack, by id.
    fraction : float
        Of each training split, as it was trained on.

    Raises
    ------
    RaptorError
        If the stacks have no validation sample.
    """
    training = TrainingSet(training_points(stacks, fraction))
    pixels: list[NDArray[np.floating]] = []
    cases: list[Case] = []
    disagreements, distances = [], []
    for number, sample, mould in _validation(stacks):
        cast = surrogate.cast(mould)
        found = surrogate.ensemble(cast, sample.parameters)
        pixels.append(_draw_pixels(found, sample, np.random.default_rng([seed, number, sample.simulation])))
        ratios = shape_ratios(sample.fields[0], cast)
        directions = alignment(sample.fields, cast), anisotropy(sample.fields)
        cases.append(Case(np.array([*ratios, *directions]), found.realisations))
        disagreements.append(disagreement(found.deviation, found.mean))
        distances.append(training.distance(_descriptors(sample)))
        on_progress(sample.simulation)
    if not cases:
        where = ", ".join(map(str, stacks))
        raise RaptorError(f"{where}: there is no validation sample; raise the campaign's validation")
    simulated = density_threshold(surrogate.layers, surrogate.pixels)
    factor = fit_threshold(cases, simulated)
    own = fit_sample_threshold(cases, simulated) if surrogate.architecture.noise else factor
    errors, deviations = np.array([case.error(own * simulated) for case in cases]).swapaxes(0, 1)
    lost = [name for name, error in zip(MEASURED, errors.T, strict=True) if not np.isfinite(error).any()]
    if lost:
        raise RaptorError(f"no validation sample has a {', '.join(lost)}; raise the campaign's validation")
    return Calibration(
        fit_scale(*np.concatenate(pixels, axis=1)),
        fit_scale(errors, deviations, np.ones_like(errors)),
        float(np.quantile(disagreements, USUAL)),
        TrainingSet(training.points, float(np.quantile(distances, USUAL))),
        factor,
        own,
    )


def training_points(stacks: Iterable[Path], fraction: float = 1.0) -> NDArray[np.float32]:
    """Descriptors (n, descriptors) of the training rows of stacks."""
    read = (read_samples(stack, training_rows(stack, fraction)) for stack in stacks)
    return np.stack([_descriptors(sample) for samples in read for sample in samples]).astype(np.float32)


def _validation(stacks: Mapping[Path, Mapping[str, Mould]]) -> Iterator[tuple[int, Sample, Mould]]:
    """Validation samples with the numbers of their stacks, and their moulds."""
    for number, (stack, moulds) in enumerate(stacks.items()):
        for sample in read_samples(stack, read_table(stack).rows("validation")):
            yield number, sample, moulds[sample.mould]


def _draw_pixels(found: Ensemble, sample: Sample, rng: np.random.Generator) -> NDArray[np.floating]:
    """Errors, deviations and sizes (3, PIXELS, 8) of pixels drawn within the depression."""
    inside = np.flatnonzero(sample.depression)
    chosen = rng.choice(inside, PIXELS, replace=len(inside) < PIXELS)
    error = without_sign(found.mean) - without_sign(sample.fields)
    size = np.broadcast_to(np.abs(found.mean[:1]), error.shape)
    return np.stack([part.reshape(len(part), -1)[:, chosen].T for part in (error, found.deviation, size)])


def fit_threshold(cases: Sequence[Case], threshold: float) -> float:
    """The factor of the threshold that minimises the mean absolute errors of A/A0 and w/w0.

    Networks blur uncertain edges, which moves the contour at the simulations' threshold outwards; a higher
    threshold brings it back.
    """

    def cost(factor: float) -> float:
        return float(np.nanmean([np.abs(case.error_of_mean(factor * threshold)[:2]) for case in cases]))

    return float(minimize_scalar(cost, bounds=FACTORS, method="bounded", options={"xatol": 1e-3}).x)


def fit_sample_threshold(cases: Sequence[Case], threshold: float) -> float:
    """The same for estimates from samples, whose errors are taken as linear in the factor, to save time."""
    ends = 1.0, 1.1
    first, last = (np.array([case.error(end * threshold)[0][:2] for case in cases]) for end in ends)

    def cost(factor: float) -> float:
        share = (factor - ends[0]) / (ends[1] - ends[0])
        return float(np.nanmean(np.abs(first + share * (last - first))))

    return float(minimize_scalar(cost, bounds=FACTORS, method="bounded", options={"xatol": 1e-3}).x)


def _descriptors(sample: Sample) -> NDArray[np.float64]:
    return descriptors(sample.depression, sample.tethers, sample.parameters)
