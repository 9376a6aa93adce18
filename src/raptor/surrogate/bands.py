"""Bands about predictions, calibrated on the validation split.

A band's half width is a factor times sigma, sigma^2 = deviation^2 + (irreducible size)^2: `deviation` is
how far networks and images of D4 disagree, `size` the predicted density where fields are concerned, as the
noise of single simulations is found where tissue is. The factor of each level is the quantile of
|error| / sigma over the validation split (split conformal prediction; Lei et al. 2018,
doi:10.1080/01621459.2017.1307116), so a band holds its share of all simulations that are drawn as those
were, whatever the errors' distribution.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raptor.surrogate.out_of_distribution import TrainingSet

LEVELS = (0.5, 0.8, 0.95)
USUAL = 0.99  # part of the validation samples that the flag lets pass
TINY = 1e-9


@dataclass(frozen=True)
class Bands:
    """Half widths (levels, ...) of bands that hold `LEVELS` of all simulations."""

    half: NDArray[np.float32]

    def hold(self, error: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Whether an error (...) lies within each band, (levels, ...)."""
        return np.asarray(np.abs(error) <= self.half)


@dataclass(frozen=True)
class ErrorScale:
    """From the deviation of networks to bands, of several quantities (n,).

    Parameters
    ----------
    irreducible : tuple of float
        Part of sigma that no agreement of networks takes away, over `size`.
    factors : tuple (levels, n)
        Half width of each level's band over sigma.
    """

    irreducible: tuple[float, ...]
    factors: tuple[tuple[float, ...], ...]

    def bands(self, deviation: NDArray[np.floating], size: NDArray[np.floating]) -> Bands:
        """Bands of quantities with a deviation (n, ...) and size (n or 1, ...)."""
        sigma = _sigma(np.array(self.irreducible), deviation, size)
        factors = np.array(self.factors).reshape(len(LEVELS), -1, *(1,) * (deviation.ndim - 1))
        return Bands((factors * sigma).astype(np.float32))


@dataclass(frozen=True)
class Calibration:
    """What was learnt of a surrogate's errors on the validation split.

    Parameters
    ----------
    fields, ratios : ErrorScale
        Of the eight fields, and of A/A0 and w/w0.
    usual_disagreement : float
        Of networks (`disagreement`), that all but a hundredth of the validation samples stay below.
    training : TrainingSet
        To which the distance of inputs is measured.
    threshold_factor : float
        Of the density above which there is tissue: predicted rims are softer, so that the simulations'
        threshold lies farther out in them.
    """

    fields: ErrorScale
    ratios: ErrorScale
    usual_disagreement: float
    training: TrainingSet
    threshold_factor: float = 1.0

    def relative_disagreement(self, deviation: NDArray[np.floating], fields: NDArray[np.floating]) -> float:
        """`disagreement` over what is usual."""
        return disagreement(deviation, fields) / self.usual_disagreement

    def as_json(self) -> dict[str, Any]:
        """As it stands in model.json; the points of the training set stand beside the weights."""
        return {
            "levels": LEVELS,
            "fields": asdict(self.fields),
            "ratios": asdict(self.ratios),
            "usual_disagreement": self.usual_disagreement,
            "usual_distance": self.training.usual,
            "threshold_factor": self.threshold_factor,
        }

    @classmethod
    def from_json(cls, content: dict[str, Any], points: NDArray[np.float32]) -> "Calibration":
        """Read back what `as_json` gave."""
        fields, ratios = (
            ErrorScale(tuple(part["irreducible"]), tuple(tuple(row) for row in part["factors"]))
            for part in (content["fields"], content["ratios"])
        )
        training = TrainingSet(points, content["usual_distance"])
        return cls(fields, ratios, content["usual_disagreement"], training, content["threshold_factor"])


def disagreement(deviation: NDArray[np.floating], fields: NDArray[np.floating]) -> float:
    """Root mean square deviation of networks about density, over that of density in the image.

    Both (8, y, x).
    """
    rms = np.sqrt((deviation[0] ** 2).mean(dtype=np.float64))
    return float(rms / (fields[0].std(dtype=np.float64) + TINY))


def fit_scale(
    error: NDArray[np.floating], deviation: NDArray[np.floating], size: NDArray[np.floating]
) -> ErrorScale:
    """The scale whose bands hold their share of errors (samples, n), of deviations and sizes alike.

    `irreducible` is half the root mean square error over that of size: enough for a band where networks
    happen to agree, not so much that disagreement counts for nothing. NaN are left out.
    """
    squares = [np.nanmean(part.astype(np.float64) ** 2, axis=0) for part in (error, size)]
    irreducible = 0.5 * np.sqrt(squares[0] / (squares[1] + TINY))
    ratio = np.abs(error) / _sigma(irreducible, np.moveaxis(deviation, -1, 0), np.moveaxis(size, -1, 0)).T
    factors = [[_conformal(column, level) for column in ratio.T] for level in LEVELS]
    return ErrorScale(tuple(float(v) for v in irreducible), tuple(tuple(row) for row in factors))


def _conformal(ratio: NDArray[np.floating], level: float) -> float:
    """The least of ratios (samples,) that a further one does not exceed with probability `level`."""
    ordered = np.sort(ratio[np.isfinite(ratio)])
    rank = math.ceil((len(ordered) + 1) * level)
    return float(ordered[min(rank, len(ordered)) - 1])


def _sigma(
    irreducible: NDArray[np.float64], deviation: NDArray[np.floating], size: NDArray[np.floating]
) -> NDArray[np.float64]:
    """sqrt(deviation^2 + (irreducible size)^2) of quantities (n, ...)."""
    own = irreducible.reshape(-1, *(1,) * (deviation.ndim - 1)) * size
    return np.asarray(np.sqrt(deviation.astype(np.float64) ** 2 + own**2 + TINY**2))
