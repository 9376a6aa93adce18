"""Bands about predictions, calibrated on the validation split.

A band's half width is a factor times sigma, sigma^2 = spread^2 + (floor size)^2: `spread` is how far
networks and images of D4 disagree, `size` the predicted density where fields are concerned, as the noise of
single simulations is found where tissue is. The factor of each level is the quantile of |error| / sigma over
the validation split (split conformal prediction; Lei et al. 2018, doi:10.1080/01621459.2017.1307116), so a
band holds its share of all simulations that are drawn as those were, whatever the errors' distribution.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raptor.surrogate.out_of_distribution import Novelty

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
class Scale:
    """From spread to bands, of several quantities (n,).

    Parameters
    ----------
    floor : tuple of float
        Part of sigma that no agreement of networks takes away, over `size`.
    factors : tuple (levels, n)
        Half width of each level's band over sigma.
    """

    floor: tuple[float, ...]
    factors: tuple[tuple[float, ...], ...]

    def bands(self, spread: NDArray[np.floating], size: NDArray[np.floating]) -> Bands:
        """Bands of quantities with a spread (n, ...) and size (n or 1, ...)."""
        sigma = _sigma(np.array(self.floor), spread, size)
        factors = np.array(self.factors).reshape(len(LEVELS), -1, *(1,) * (spread.ndim - 1))
        return Bands((factors * sigma).astype(np.float32))


@dataclass(frozen=True)
class Calibration:
    """What was learnt of a surrogate's errors on the validation split.

    Parameters
    ----------
    fields, shapes : Scale
        Of the eight fields, and of A/A0 and w/w0.
    disagreement : float
        Of networks about density (`relative_spread`), that all but a hundredth of samples stay below.
    novelty : Novelty
        Distance to the training set.
    edge : float
        Where a tissue ends in predicted densities, over where it ends in simulated ones: predicted edges are
        softer, so that the same threshold lies farther out.
    """

    fields: Scale
    shapes: Scale
    disagreement: float
    novelty: Novelty
    edge: float = 1.0

    def disagreement_of(self, spread: NDArray[np.floating], fields: NDArray[np.floating]) -> float:
        """Disagreement of networks about density over what is usual."""
        return relative_spread(spread, fields) / self.disagreement

    def as_json(self) -> dict[str, Any]:
        """As it stands in model.json; the points of the training set stand beside the weights."""
        return {
            "levels": LEVELS,
            "fields": {"floor": self.fields.floor, "factors": self.fields.factors},
            "shapes": {"floor": self.shapes.floor, "factors": self.shapes.factors},
            "disagreement": self.disagreement,
            "distance": self.novelty.usual,
            "edge": self.edge,
        }

    @classmethod
    def from_json(cls, content: dict[str, Any], points: NDArray[np.float32]) -> "Calibration":
        """Read back what `as_json` gave."""
        fields, shapes = (
            Scale(tuple(part["floor"]), tuple(tuple(row) for row in part["factors"]))
            for part in (content["fields"], content["shapes"])
        )
        novelty = Novelty(points, content["distance"])
        return cls(fields, shapes, content["disagreement"], novelty, content.get("edge", 1.0))


def relative_spread(spread: NDArray[np.floating], fields: NDArray[np.floating]) -> float:
    """Root mean square spread of density (8, y, x) over the deviation of density, in the image."""
    return float(np.sqrt((spread[0] ** 2).mean(dtype=np.float64)) / (fields[0].std(dtype=np.float64) + TINY))


def fit_scale(error: NDArray[np.floating], spread: NDArray[np.floating], size: NDArray[np.floating]) -> Scale:
    """The scale whose bands hold their share of errors (samples, n), of spreads and sizes alike.

    The floor is half the root mean square error over that of size: enough for a band where networks
    happen to agree, not so much that disagreement counts for nothing. NaN are left out.
    """
    squares = [np.nanmean(part.astype(np.float64) ** 2, axis=0) for part in (error, size)]
    floor = 0.5 * np.sqrt(squares[0] / (squares[1] + TINY))
    ratio = np.abs(error) / _sigma(floor, np.moveaxis(spread, -1, 0), np.moveaxis(size, -1, 0)).T
    factors = [[_conformal(column, level) for column in ratio.T] for level in LEVELS]
    return Scale(tuple(float(v) for v in floor), tuple(tuple(row) for row in factors))


def _conformal(ratio: NDArray[np.floating], level: float) -> float:
    """The least of ratios (samples,) that a further one does not exceed with probability `level`."""
    ordered = np.sort(ratio[np.isfinite(ratio)])
    rank = math.ceil((len(ordered) + 1) * level)
    return float(ordered[min(rank, len(ordered)) - 1])


def _sigma(
    floor: NDArray[np.float64], spread: NDArray[np.floating], size: NDArray[np.floating]
) -> NDArray[np.float64]:
    """sqrt(spread^2 + (floor size)^2) of quantities (n, ...)."""
    wide = floor.reshape(-1, *(1,) * (spread.ndim - 1))
    return np.asarray(np.sqrt(spread.astype(np.float64) ** 2 + (wide * size) ** 2 + TINY**2))
