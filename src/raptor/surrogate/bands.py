"""Bands about predictions, calibrated on the validation split.

A band's half width is a factor times sigma, sigma^2 = deviation^2 + (irreducible size)^2. `deviation` is
the disagreement of networks and images of D4; for fields `size` is the predicted density, because single
simulations are noisy where there is tissue. The factor of each level is the quantile of |error| / sigma
over the validation split (split conformal prediction; Lei et al. 2018,
doi:10.1080/01621459.2017.1307116), so a band covers its share of simulations from the same distribution,
whatever the distribution of the errors.
"""

import math
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raptor.surrogate.out_of_distribution import TrainingSet

LEVELS = (0.5, 0.8, 0.95)
MEASURED = ("area_ratio", "width_ratio", "alignment", "anisotropy")
"""Measures of a tissue that are predicted with bands."""

USUAL = 0.99  # share of the validation samples that are not flagged
TINY = 1e-9
NORMAL = 1.96
"""Standard deviations of a normal error to either end of its 95 % band."""


@dataclass(frozen=True)
class Bands:
    """Bands that cover the shares `LEVELS` of simulations.

    Parameters
    ----------
    factors : ndarray (levels, n, 1, ...)
        Half widths over sigma.
    sigma : ndarray (n, ...)
    """

    factors: NDArray[np.floating]
    sigma: NDArray[np.floating]

    @cached_property
    def half(self) -> NDArray[np.float32]:
        """Half widths (levels, n, ...)."""
        return (self.factors * self.sigma).astype(np.float32)

    def hold(self, error: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Whether an error (...) lies within each band, (levels, ...)."""
        return np.asarray(np.abs(error) <= self.half)


@dataclass(frozen=True)
class ErrorScale:
    """Converts the deviation of networks to bands, for several quantities (n,).

    Parameters
    ----------
    irreducible : tuple of float
        Part of sigma that remains if all networks agree, over `size`.
    factors : tuple (levels, n)
        Half width of each level's band over sigma.
    """

    irreducible: tuple[float, ...]
    factors: tuple[tuple[float, ...], ...]

    def bands(self, deviation: NDArray[np.floating], size: NDArray[np.floating]) -> Bands:
        """Bands of quantities with a deviation (n, ...) and size (n or 1, ...)."""
        sigma = _sigma(np.array(self.irreducible, deviation.dtype), deviation, size)
        factors = np.array(self.factors).reshape(len(LEVELS), -1, *(1,) * (deviation.ndim - 1))
        return Bands(factors, sigma)


@dataclass(frozen=True)
class Calibration:
    """Calibration of a surrogate's errors on the validation split.

    Parameters
    ----------
    fields, measures : ErrorScale
        Of the eight fields, and of `MEASURED`.
    usual_disagreement : float
        Of networks (`disagreement`): the value that 99 % of the validation samples stay below.
    training : TrainingSet
        The training set, to which the distance of inputs is measured.
    threshold_factor : float
        Factor of the density above which there is tissue in means: their edges are blurred, which moves the
        contour at the simulations' threshold outwards.
    own_factor : float
        The same of realisations: samples, whose edges are nearly sharp, or the means of single networks.
    """

    fields: ErrorScale
    measures: ErrorScale
    usual_disagreement: float
    training: TrainingSet
    threshold_factor: float = 1.0
    own_factor: float = 1.0

    def relative_disagreement(self, deviation: NDArray[np.floating], fields: NDArray[np.floating]) -> float:
        """`disagreement` over its usual value."""
        return disagreement(deviation, fields) / self.usual_disagreement

    def as_json(self) -> dict[str, Any]:
        """As stored in model.json; the points of the training set are stored with the weights."""
        return {
            "levels": LEVELS,
            "fields": asdict(self.fields),
            "measures": asdict(self.measures),
            "usual_disagreement": self.usual_disagreement,
            "usual_distance": self.training.usual,
            "threshold_factor": self.threshold_factor,
            "own_factor": self.own_factor,
        }

    @classmethod
    def from_json(cls, content: dict[str, Any], points: NDArray[np.float32]) -> "Calibration":
        """The inverse of `as_json`."""
        fields, measures = (
            ErrorScale(tuple(part["irreducible"]), tuple(tuple(row) for row in part["factors"]))
            for part in (content["fields"], content["measures"])
        )
        training = TrainingSet(points, content["usual_distance"])
        known = (content[name] for name in ("threshold_factor", "own_factor"))
        return cls(fields, measures, content["usual_disagreement"], training, *known)


def disagreement(deviation: NDArray[np.floating], fields: NDArray[np.floating]) -> float:
    """Root mean square deviation of networks about density, over that of density in the image.

    Both (8, y, x).
    """
    rms = np.sqrt((deviation[0] ** 2).mean(dtype=np.float64))
    return float(rms / (fields[0].std(dtype=np.float64) + TINY))


def fit_scale(
    error: NDArray[np.floating], deviation: NDArray[np.floating], size: NDArray[np.floating]
) -> ErrorScale:
    """The scale whose bands cover their share of errors (samples, n), given deviations and sizes.

    `irreducible` is half the root mean square error over that of size: enough for a band where networks
    happen to agree, and little enough that disagreement matters. NaN are ignored.
    """
    squares = [np.nanmean(part.astype(np.float64) ** 2, axis=0) for part in (error, size)]
    irreducible = 0.5 * np.sqrt(squares[0] / (squares[1] + TINY))
    ratio = np.abs(error) / _sigma(irreducible, np.moveaxis(deviation, -1, 0), np.moveaxis(size, -1, 0)).T
    factors = [[_conformal(column, level) for column in ratio.T] for level in LEVELS]
    return ErrorScale(tuple(float(v) for v in irreducible), tuple(tuple(row) for row in factors))


def _conformal(ratio: NDArray[np.floating], level: float) -> float:
    """The smallest of ratios (samples,) that a new one stays below with probability `level`."""
    ordered = np.sort(ratio[np.isfinite(ratio)])
    rank = math.ceil((len(ordered) + 1) * level)
    return float(ordered[min(rank, len(ordered)) - 1])


def _sigma(
    irreducible: NDArray[np.floating], deviation: NDArray[np.floating], size: NDArray[np.floating]
) -> NDArray[np.floating]:
    """sqrt(deviation^2 + (irreducible size)^2) of quantities (n, ...)."""
    own = irreducible.reshape(-1, *(1,) * (deviation.ndim - 1)) * size
    return np.asarray(np.sqrt(deviation**2 + own**2 + TINY**2))
