"""Experimental design: the measurement that would narrow the posterior most.

For each candidate, hypothetical tissues are drawn from the posterior and measured with an error, and the
posterior is reweighted with each of these measurements; the remaining variances of the parameters, averaged
over the tissues, rank the candidates. Simulations at posterior draws measure the surrogate's error of each
candidate, which is added to the measurement error, and the thickness of tissues, which no field shows.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from raptor.fitting.measurements import CANDIDATES, SEEN, Candidate, seen, thickness_ratio
from raptor.fitting.posterior import Posterior, moments
from raptor.fitting.simulator import Simulator
from raptor.fitting.targets import PARAMETERS, Target, parameters_at
from raptor.moulds.geometry import Mould

DRAWS = 8  # simulations at posterior draws, for the surrogate's error there and for thickness
DRAWN = 3000  # points that represent the posterior
TISSUES = 200  # hypothetical tissues
LEAST = 5  # simulations needed to fit a plane of thickness over the parameters


@dataclass(frozen=True)
class Sampled:
    """Simulations at draws from a posterior.

    Parameters
    ----------
    units : ndarray (n, 3)
        Positions in the unit cube.
    table : DataFrame
        Parameters; each of `SEEN`, simulated and predicted (`{name}_predicted`); `thickness`; `converged`.
    """

    units: NDArray[np.float64]
    table: pd.DataFrame


def simulate_draws(
    posterior: Posterior,
    simulator: Simulator,
    mould: Mould,
    count: int = DRAWS,
    on_progress: Callable[[str], None] = lambda note: None,
) -> Sampled:
    """Simulate a tissue at draws from its posterior, evenly along it."""
    chosen = posterior.draws(count, simulator.seed) if count else np.empty(0, dtype=int)
    cast = simulator.cast(mould)
    rows = []
    for number in chosen:
        made = simulator.run(mould, parameters_at(posterior.units[number]))
        found = seen(simulator.fields(made), cast, cast.threshold)
        row = dict(zip(PARAMETERS, posterior.parameters[number], strict=True))
        row |= dict(zip(SEEN, found, strict=True))
        row |= {f"{name}_predicted": posterior.values[number, k] for k, name in enumerate(SEEN)}
        rows.append(row | {"thickness": thickness_ratio(made), "converged": made.converged})
        on_progress(str(made))
    names = [*PARAMETERS, *SEEN, *(f"{name}_predicted" for name in SEEN), "thickness", "converged"]
    return Sampled(posterior.units[chosen], pd.DataFrame(rows, columns=names))


def rank_measurements(posterior: Posterior, sampled: Sampled, target: Target, seed: int) -> pd.DataFrame:
    """Candidates for the next measurement, the most informative first.

    Columns `left_{parameter}` and `left` (root mean square over parameters) are standard deviations expected
    after the measurement, over those before it; `measurement_error` and `model_error` are the assumed errors;
    `spread` is the candidate's own deviation over the posterior. `left_exact_model` is `left` for a model
    without error.
    """
    generator = np.random.default_rng(seed)
    drawn = generator.choice(len(posterior.weights), DRAWN, p=posterior.weights)
    parameters, values = posterior.parameters[drawn], _values(posterior, sampled, drawn)
    errors = _model_errors(sampled)
    measured = {name for column, name in enumerate(SEEN[:2]) if column in target.columns}
    rows = []
    for candidate in CANDIDATES:
        shown = [values[part] for part in candidate.parts if part in values]
        if measured & set(candidate.parts) or not shown or not np.isfinite(shown).all():
            continue
        of_model = np.array([errors.get(part, 0.0) for part in candidate.parts])
        rows.append(_row(candidate, np.stack(shown, axis=1), of_model, parameters, generator))
    return pd.DataFrame(rows).sort_values("left", ignore_index=True)


def expected_left(
    parameters: NDArray[np.float64],
    values: NDArray[np.float64],
    errors: NDArray[np.float64],
    generator: np.random.Generator,
) -> NDArray[np.float64]:
    """Expected standard deviation after a measurement over that before it, of each parameter, (p,).

    Parameters
    ----------
    parameters : ndarray (n, p)
        Equally likely draws.
    values : ndarray (n, k)
        The candidate's values there.
    errors : ndarray (k,)
        Standard errors of model and measurement combined.
    """
    truths = generator.choice(len(values), TISSUES, replace=len(values) < TISSUES)
    variances = np.zeros(parameters.shape[1])
    for truth in truths:
        seen_there = values[truth] + errors * generator.standard_normal(len(errors))
        exponent = -0.5 * (((values - seen_there) / errors) ** 2).sum(axis=1)
        weights = np.exp(exponent - exponent.max())
        variances += moments(parameters, weights / weights.sum())[1] ** 2
    return np.asarray(np.sqrt(variances / len(truths)) / parameters.std(axis=0))


def _row(
    candidate: Candidate,
    shown: NDArray[np.float64],
    of_model: NDArray[np.float64],
    parameters: NDArray[np.float64],
    generator: np.random.Generator,
) -> dict[str, float | str]:
    """A candidate's row of the table."""
    scale = np.abs(shown).mean(axis=0) if candidate.relative else 1.0
    error = np.broadcast_to(np.maximum(candidate.error * scale, 1e-9), of_model.shape)
    left = expected_left(parameters, shown, np.hypot(error, of_model), generator)
    exact = expected_left(parameters, shown, error, generator)
    return {
        "measurement": candidate.name,
        "label": candidate.label,
        "measurement_error": float(error.mean()),
        "model_error": float(of_model.mean()),
        "spread": float(shown.std(axis=0).mean()),
        **{f"left_{name}": float(value) for name, value in zip(PARAMETERS, left, strict=True)},
        "left": float(np.sqrt((left**2).mean())),
        "left_exact_model": float(np.sqrt((exact**2).mean())),
    }


def _values(
    posterior: Posterior, sampled: Sampled, drawn: NDArray[np.intp]
) -> dict[str, NDArray[np.float64]]:
    """Measured quantities at draws, by name, (draws,); thickness from the plane through the simulations."""
    values = {name: posterior.values[drawn, column] for column, name in enumerate(posterior.names)}
    thickness = sampled.table["thickness"].to_numpy(dtype=float)
    if len(thickness) >= LEAST and np.isfinite(thickness).all():
        values["thickness"] = _plane(posterior.units[drawn]) @ _coefficients(sampled, thickness)[0]
    return values


def _model_errors(sampled: Sampled) -> dict[str, float]:
    """Root mean square errors of the surrogate at simulated draws, and of the plane of thickness."""
    if sampled.table.empty:
        return {}
    table = sampled.table
    errors = {name: float(np.sqrt(((table[name] - table[f"{name}_predicted"]) ** 2).mean())) for name in SEEN}
    thickness = table["thickness"].to_numpy(dtype=float)
    if len(thickness) >= LEAST and np.isfinite(thickness).all():
        errors["thickness"] = _coefficients(sampled, thickness)[1]
    return errors


def _plane(units: NDArray[np.float64]) -> NDArray[np.float64]:
    """Terms (n, 4) of a plane over points (n, 3)."""
    return np.column_stack([np.ones(len(units)), units])


def _coefficients(sampled: Sampled, values: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Coefficients (4,) of the plane through values (n,), and its residual standard deviation."""
    terms = _plane(sampled.units)
    coefficients = np.asarray(np.linalg.lstsq(terms, values, rcond=None)[0], dtype=np.float64)
    rest = values - terms @ coefficients
    return coefficients, float(np.sqrt((rest**2).sum() / max(len(values) - terms.shape[1], 1)))
