"""Errors of predicted fields, and the paper's bulk statistics."""

import numpy as np
from numpy.typing import NDArray

from raptor.core.arrays import Array, library_of
from raptor.symmetry import FIELDS

BULK = ("P", "N", "T", "Tbar", "SxSx", "SxSxbar", "SySy", "SySybar")
"""Mean density, pixels above the threshold, and means of fields and normalised fields."""


def vrmse(prediction: NDArray[np.floating], target: NDArray[np.floating]) -> NDArray[np.float64]:
    """Root mean square error over the target's standard deviation, over the last two axes.

    1 is the error of predicting the target's own mean; the headline error of The Well (Ohana et
    al., 2024, arXiv:2412.00568).
    """
    error = ((prediction - target) ** 2).mean(axis=(-2, -1), dtype=np.float64)
    return np.asarray(np.sqrt(error / (target.var(axis=(-2, -1), dtype=np.float64) + 1e-12)))


def nrmse(prediction: NDArray[np.floating], target: NDArray[np.floating]) -> NDArray[np.float64]:
    """Root mean square error over the target's root mean square, over the last two axes."""
    error = ((prediction - target) ** 2).mean(axis=(-2, -1), dtype=np.float64)
    return np.asarray(np.sqrt(error / ((target**2).mean(axis=(-2, -1), dtype=np.float64) + 1e-12)))


def without_sign(fields: Array) -> Array:
    """Fields (..., 8, y, x) with sxsz and sysz by magnitude, as their sign is spontaneous.

    numpy arrays and torch tensors alike.
    """
    signed = FIELDS.index("sxsz")  # and what follows it
    parts = [fields[..., :signed, :, :], abs(fields[..., signed:, :, :])]
    return library_of(fields).concat(parts, -3)  # type: ignore[no-any-return]


def pearson(a: NDArray[np.floating], b: NDArray[np.floating]) -> float:
    """Pearson's correlation of two equally long series; NaN where one of them is constant."""
    a, b = (np.asarray(v, dtype=np.float64) - np.mean(v, dtype=np.float64) for v in (a, b))
    size = np.sqrt((a * a).sum() * (b * b).sum())
    return float((a * b).sum() / size) if size > 0 else float("nan")


def field_pearson(prediction: NDArray[np.floating], target: NDArray[np.floating]) -> list[float]:
    """Pearson's correlation over pixels, a field, of one sample (fields, y, x)."""
    return [pearson(p.ravel(), t.ravel()) for p, t in zip(prediction, target, strict=True)]


def normalised(fields: NDArray[np.floating], cells: int) -> NDArray[np.floating]:
    """Zbar_p = (N_p / N_c) Z_p, whose mean over pixels is the mean over cells (paper, eq. 5)."""
    return np.asarray(fields * (fields.shape[-1] * fields.shape[-2] / cells))


def bulk_statistics(fields: NDArray[np.floating], cells: int, threshold: float) -> dict[str, float]:
    """The paper's eight bulk statistics of one sample (fields, y, x), keyed by `BULK`.

    Parameters
    ----------
    cells : int
        Number of cells; barred quantities are means over cells, the others over pixels.
    threshold : float
        Density per pixel above which there is tissue.
    """
    means = dict(zip(FIELDS, fields.mean(axis=(-2, -1), dtype=np.float64), strict=True))
    bars = dict(zip(FIELDS, normalised(fields, cells).mean(axis=(-2, -1), dtype=np.float64), strict=True))
    return {
        "P": float(means["density"]),
        "N": float(np.count_nonzero(fields[0] > threshold)),
        "T": float(means["tension"]),
        "Tbar": float(bars["tension"]),
        "SxSx": float(means["sxsx"]),
        "SxSxbar": float(bars["sxsx"]),
        "SySy": float(means["sysy"]),
        "SySybar": float(bars["sysy"]),
    }
