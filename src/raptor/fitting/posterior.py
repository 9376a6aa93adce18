"""Posterior of the parameters over the whole region, and profile likelihoods.

The surrogate is evaluated at Sobol points that fill the region and interpolated between them (cubic radial
basis functions), so that tens of thousands of further Sobol points are cheap. Each is weighted by its
likelihood: in three dimensions this is plain quadrature, without a chain that could miss an end of the
valley.

The likelihood of a measured ratio m at predicted ratio p is normal with

    sigma^2 = error^2 + (h / 1.96)^2 + i^2,

where `error` is that of the measurement, h the half width of the surrogate's calibrated 95 % band there, and
i the interpolation error. The prior is the paper's distribution: delta uniform, both kappas uniform over
their bounded plane.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator
from scipy.linalg import eigh
from scipy.stats import chi2, qmc

from raptor.core.errors import RaptorError
from raptor.core.jobs import in_threads
from raptor.fitting.measurements import SEEN, seen
from raptor.fitting.targets import PARAMETERS, Target, parameters_at, prior_density, values_at
from raptor.moulds.geometry import Mould
from raptor.parameters import BOUNDS
from raptor.surrogate.bands import LEVELS, NORMAL

if TYPE_CHECKING:  # tables and figures do not wait for torch
    from raptor.surrogate.inference import Surrogate

POINTS = 32  # Sobol points at which the surrogate is evaluated; interpolation errs by less than 0.003
RATIO_ERROR = 0.01  # standard error of a measured area or width ratio
DENSE = 2**16  # points of the posterior
QUANTILES = (0.025, 0.16, 0.5, 0.84, 0.975)
BINS = 40  # of a profile
BEST = 0.1  # chi2 above its minimum: a third of a standard deviation
UNLIKELY = 0.01  # probability of a larger chi2 below which the measurement is out of reach


@dataclass(frozen=True)
class Survey:
    """A model's values over the whole region.

    Parameters
    ----------
    units : ndarray (n, 3)
        Points of the unit cube (`targets.parameters_at`).
    values : ndarray (n, k)
        Measured quantities there, in the order `names`; area and width ratio first.
    sigma : ndarray (n, 2)
        Standard error of the model's area and width ratio there.
    """

    units: NDArray[np.float64]
    values: NDArray[np.float64]
    sigma: NDArray[np.float64]
    names: tuple[str, ...] = SEEN

    def shifted(self, shift: NDArray[np.float64]) -> "Survey":
        """With a constant (2,) added to A/A0 and w/w0; NaN counts as zero."""
        values = self.values.copy()
        values[:, :2] += np.nan_to_num(shift)
        return replace(self, values=values)


@dataclass(frozen=True)
class Posterior:
    """Points of the region, weighted by the measurement.

    Parameters
    ----------
    units, parameters : ndarray (n, 3)
        Points in the unit cube and as parameters.
    values : ndarray (n, k)
        The model's values there, in the order `names`.
    prior, weights : ndarray (n,)
        Weights before and after the measurement; each sums to 1.
    log_likelihood : ndarray (n,)
    chi2 : ndarray (n,)
        Sum of squared residuals over their variances.
    measurements : int
        Number of measurements.
    """

    units: NDArray[np.float64]
    parameters: NDArray[np.float64]
    values: NDArray[np.float64]
    names: tuple[str, ...]
    prior: NDArray[np.float64]
    weights: NDArray[np.float64]
    log_likelihood: NDArray[np.float64]
    chi2: NDArray[np.float64]
    measurements: int

    @cached_property
    def effective(self) -> float:
        """Effective number of equally weighted points."""
        return float(1 / (self.weights**2).sum())

    @property
    def middle(self) -> NDArray[np.float64]:
        """The point (3,) of the cube nearest to the posterior's mean among those that fit best."""
        best = self.units[self.chi2 < self.chi2.min() + BEST]
        return np.asarray(best[np.linalg.norm(best - self.weights @ self.units, axis=1).argmin()])

    def draws(self, count: int, seed: int) -> NDArray[np.intp]:
        """Indices (count,) of points drawn by weight, evenly along the posterior's longest axis."""
        along = self.units @ _longest(self)
        order = np.argsort(along, kind="stable")
        places = (np.arange(count) + np.random.default_rng(seed).random()) / count
        found = np.searchsorted(np.cumsum(self.weights[order]), places)
        return np.asarray(order[np.minimum(found, len(order) - 1)])


def survey(
    surrogate: "Surrogate",
    mould: Mould,
    seed: int,
    points: int = POINTS,
    on_progress: Callable[[str], None] = lambda note: None,
    threads: int | None = None,
) -> Survey:
    """Evaluate the surrogate for a mould at points (a power of two) that fill the region.

    Predictions and bands are those of `Surrogate.examine`. `threads` compute them, each torch's on one; None:
    one for each processor.

    Raises
    ------
    RaptorError
        If the surrogate is not calibrated, or the mould holds no cell.
    """
    units = qmc.Sobol(3, seed=seed).random(points)
    cast = surrogate.cast(mould)

    def examined(unit: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        found = surrogate.examine(cast, parameters_at(unit))
        half = found.measure_bands.half[LEVELS.index(0.95), :2]
        return seen(found.values, cast, surrogate.threshold), np.asarray(half, dtype=np.float64)

    values, bands = [], []
    for measured, half in in_threads(examined, list(units), threads):
        values.append(measured)
        bands.append(half)
        on_progress(f"{len(values)} of {points} predictions over the region")
    found = np.array(values)
    found[np.isnan(found) & ~np.isnan(found).all(axis=0)] = 0.0  # a tissue torn at a section has no width
    return Survey(units, found, np.array(bands) / NORMAL)


def infer(
    found: Survey, target: Target, seed: int, error: float = RATIO_ERROR, dense: int = DENSE
) -> Posterior:
    """Weight the region by a measurement with a standard error.

    Raises
    ------
    RaptorError
        If a measurement is not possible on the mould.
    """
    if not np.isfinite(found.values[:, target.columns]).all():
        raise RaptorError(
            "the measured ratios cannot be computed everywhere on this mould: a tether may fill its central "
            "section; give the area ratio alone, or another mould"
        )
    units = qmc.Sobol(3, seed=seed + 1).random(dense)
    values = interpolate(found.units, found.values, units)
    bands = interpolate(found.units, found.sigma, units, smoothing=1e-2)
    columns = target.columns
    variance = error**2 + np.clip(bands, found.sigma.min(axis=0), found.sigma.max(axis=0)) ** 2
    variance = (variance + interpolation_error(found)[:2] ** 2)[:, columns]
    squares = target.residuals(values[:, :2]) ** 2 / variance
    log_likelihood = -0.5 * (squares + np.log(2 * np.pi * variance)).sum(axis=1)
    prior = prior_density(units)
    weights = prior * np.exp(log_likelihood - log_likelihood.max())
    return Posterior(
        units,
        values_at(units),
        values,
        found.names,
        prior / prior.sum(),
        weights / weights.sum(),
        log_likelihood,
        squares.sum(axis=1),
        len(columns),
    )


def interpolate(
    units: NDArray[np.float64],
    values: NDArray[np.float64],
    at: NDArray[np.float64],
    smoothing: float = 1e-4,
) -> NDArray[np.float64]:
    """Values (n, k) at points (n, 3) interpolated to others (m, 3): (m, k); columns with NaN stay NaN."""
    known = np.isfinite(values).all(axis=0)
    answer = np.full((len(at), values.shape[1]), np.nan)
    if known.any():
        answer[:, known] = RBFInterpolator(
            units, values[:, known], smoothing=smoothing, kernel="cubic", degree=2
        )(at)
    return answer


def interpolation_error(found: Survey) -> NDArray[np.float64]:
    """Root mean square error (k,) at the points of a survey, each interpolated from all others."""
    others = ~np.eye(len(found.units), dtype=bool)
    guess = [
        interpolate(found.units[rest], found.values[rest], unit[None])[0]
        for rest, unit in zip(others, found.units, strict=True)
    ]
    return np.asarray(np.sqrt(((np.array(guess) - found.values) ** 2).mean(axis=0)))


def summarise(posterior: Posterior) -> dict[str, Any]:
    """Intervals, profiles and identifiability, as JSON.

    For each parameter: mean and standard deviation, prior and posterior; quantiles; the 95 % interval of the
    profile likelihood, and whether it ends at a bound of the region instead of one set by the data.
    `directions` are combinations of parameters, over their prior deviations, from the best to the least
    determined, with the share of the prior's deviation that is `left`. `reachable` is false if even the best
    point is further from the measurement than errors explain; the intervals are then meaningless.
    """
    profiles = {name: profile(posterior, name) for name in PARAMETERS}
    left, directions = identified(posterior)
    mean, deviation = moments(posterior.parameters, posterior.weights)
    before = moments(posterior.parameters, posterior.prior)[1]
    return {
        "effective_points": posterior.effective,
        "least_chi2": float(posterior.chi2.min()),
        "reachable": bool(chi2.sf(posterior.chi2.min(), posterior.measurements) > UNLIKELY),
        "part_of_region": float(posterior.prior[_likely(posterior)].sum()),
        "parameters": {
            name: {
                "mean": float(mean[column]),
                "std": float(deviation[column]),
                "prior_std": float(before[column]),
                "quantiles": _quantiles(posterior.parameters[:, column], posterior.weights),
                "profile_interval": _interval(*profiles[name], name),
            }
            for column, name in enumerate(PARAMETERS)
        },
        "correlations": _correlations(posterior),
        "directions": [
            {"left": float(part), **dict(zip(PARAMETERS, map(float, direction), strict=True))}
            for part, direction in zip(left, directions, strict=True)
        ],
        "determined": int((left < 0.5).sum()),
        "profiles": {
            name: {"value": values.tolist(), "log_likelihood": heights.tolist()}
            for name, (values, heights) in profiles.items()
        },
    }


def profile(posterior: Posterior, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A parameter's values (bins,), and at each the maximum log likelihood (bins,) over the others.

    Relative to the global maximum; -inf in bins without points.
    """
    bounds, column = BOUNDS[name], PARAMETERS.index(name)
    edges = np.linspace(bounds.lower, bounds.upper, BINS + 1)
    number = np.clip(np.searchsorted(edges, posterior.parameters[:, column], side="right") - 1, 0, BINS - 1)
    best = np.full(BINS, -np.inf)
    np.maximum.at(best, number, posterior.log_likelihood)
    return (edges[1:] + edges[:-1]) / 2, best - best.max()


def identified(posterior: Posterior) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Share (3,) of the prior's deviation left along combinations of parameters (3, 3), smallest first.

    The combinations are those of the generalised eigenvalue problem of both covariances, of length 1 in
    parameters over their prior deviations.
    """
    scaled = posterior.parameters / moments(posterior.parameters, posterior.prior)[1]
    after, before = (np.cov(scaled.T, aweights=w, ddof=0) for w in (posterior.weights, posterior.prior))
    variances, vectors = eigh(after, before)
    directions = vectors.T / np.linalg.norm(vectors, axis=0)[:, None]
    return np.sqrt(np.clip(variances, 0, None)), directions


def moments(
    values: NDArray[np.float64], weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weighted mean and standard deviation (k,) of values (n, k)."""
    mean = weights @ values
    return mean, np.sqrt(weights @ (values - mean) ** 2)


def _longest(posterior: Posterior) -> NDArray[np.float64]:
    """Direction (3,) in the cube along which the posterior is longest."""
    covariance = np.cov(posterior.units.T, aweights=posterior.weights, ddof=0)
    return np.asarray(np.linalg.eigh(covariance)[1][:, -1])


def _likely(posterior: Posterior) -> NDArray[np.bool_]:
    """Points (n,) within the joint 95 % region of the likelihood ratio of three parameters."""
    limit = posterior.log_likelihood.max() - chi2.ppf(0.95, 3) / 2
    return np.asarray(posterior.log_likelihood > limit)


def _quantiles(values: NDArray[np.float64], weights: NDArray[np.float64]) -> dict[str, float]:
    """Weighted quantiles of values (n,), by level."""
    order = np.argsort(values)
    found = np.interp(QUANTILES, np.cumsum(weights[order]), values[order])
    return {str(level): float(value) for level, value in zip(QUANTILES, found, strict=True)}


def _interval(centres: NDArray[np.float64], heights: NDArray[np.float64], name: str) -> dict[str, Any]:
    """The interval where a profile lies within the 95 % likelihood ratio of one parameter."""
    inside = np.flatnonzero(heights > -chi2.ppf(0.95, 1) / 2)
    half = (centres[1] - centres[0]) / 2
    first, last = int(inside[0]), int(inside[-1])
    return {
        "lower": float(centres[first] - half),
        "upper": float(centres[last] + half),
        "open_below": first == 0,
        "open_above": last == len(centres) - 1 or not np.isfinite(heights[last + 1]),
    }


def _correlations(posterior: Posterior) -> dict[str, float]:
    """Of each pair of parameters."""
    covariance = np.cov(posterior.parameters.T, aweights=posterior.weights, ddof=0)
    deviation = np.sqrt(np.diag(covariance))
    pairs = ((0, 1), (0, 2), (1, 2))
    return {
        f"{PARAMETERS[a]}, {PARAMETERS[b]}": float(covariance[a, b] / (deviation[a] * deviation[b]))
        for a, b in pairs
    }
