"""Uneven illumination: a smooth field that multiplies the brightness of the whole picture.

The logarithm of brightness is fitted as a polynomial in the two coordinates plus one constant for
each kind of surface (plate, floor, tissue): retrospective shading correction (Likar, Maintz,
Viergever and Pernus 2000, J. Microsc. 197, 285).
"""

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, label

DARKEST = 0.004  # of the brightest pixel, about a level of 8 bits; keeps logarithms finite
MOST_PIXELS = 30_000  # used by a fit
TRIMMED = 3.0  # standard deviations; larger residuals are left out of the next fit
FRAME = 0.03  # of the shorter side: the strip along the picture's border that shows the plate
PLATE = 5.0  # standard deviations within which a pixel looks like the plate
LEAST_SPREAD = 0.002  # half a level of 8 bits: a picture without noise still has rounding
IGNORED = -1


def log_brightness(values: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """Logarithm of brightness (row, column), smoothed by a Gaussian of `sigma` pixels."""
    return np.asarray(np.log(np.maximum(gaussian_filter(values, sigma), DARKEST)))


def fit_light(
    log: NDArray[np.float64], labels: NDArray[np.int8], degree: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Logarithm of the illumination (row, column), mean 0, and of each label's level, by least squares.

    Parameters
    ----------
    log : array (row, column)
        Logarithm of brightness.
    labels : array (row, column)
        Kind of surface, from 0; IGNORED where unknown.
    degree : int
        Of the polynomial.
    """
    rows, columns = (np.linspace(-1, 1, side) for side in log.shape)
    chosen = np.flatnonzero(labels != IGNORED)
    chosen = chosen[:: max(1, len(chosen) // MOST_PIXELS)]
    row, column = np.unravel_index(chosen, log.shape)
    powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i) if i + j > 0]
    terms = legendre.legvander2d(rows[row], columns[column], [degree, degree])
    terms = terms[:, [i * (degree + 1) + j for i, j in powers]]
    kinds = labels.ravel()[chosen, None] == np.arange(labels.max() + 1)
    matrix, values = np.hstack([terms, kinds]), log.ravel()[chosen]
    kept = np.ones(len(values), dtype=bool)
    for _ in range(3):
        solution = np.linalg.lstsq(matrix[kept], values[kept], rcond=None)[0]
        misses = values - matrix @ solution
        kept = np.abs(misses) <= TRIMMED * np.std(misses[kept]) + 1e-12
    coefficients = np.zeros((degree + 1, degree + 1))
    coefficients[tuple(np.transpose(powers))] = solution[: len(powers)]
    light = np.asarray(legendre.leggrid2d(rows, columns, coefficients), dtype=np.float64)
    return light, np.asarray(solution[len(powers) :], dtype=np.float64)


def find_plate(log: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.float64], float]:
    """The plate: pixels that look like the picture's border and are connected to it.

    Returns
    -------
    plate : array (row, column)
        Where the plate around the mould is visible.
    flat : array (row, column)
        Logarithm of brightness over that of the plate, illumination removed.
    spread : float
        Standard deviation of `flat` on the plate.
    """
    strip = max(2, round(FRAME * min(log.shape)))
    plate = np.ones(log.shape, dtype=bool)
    plate[strip:-strip, strip:-strip] = False
    for degree in (2, 2, 3, 3):  # a thin frame determines at most degree 3
        light, levels = fit_light(log, np.where(plate, 0, IGNORED).astype(np.int8), degree)
        flat = log - light - levels[0]
        spread = max(LEAST_SPREAD, float(1.4826 * np.median(np.abs(flat[plate]))))
        pieces, _ = label(np.abs(flat) < PLATE * spread)
        edge = np.concatenate([pieces[0], pieces[-1], pieces[:, 0], pieces[:, -1]])
        plate = np.isin(pieces, np.unique(edge[edge > 0]))
    return plate, flat, spread
