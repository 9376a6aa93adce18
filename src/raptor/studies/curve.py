"""Curves of a mould of one's own: ratios, alignment and tethers held over parameters."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd

from raptor.condor.simulate import simulate
from raptor.moulds.geometry import Mould
from raptor.moulds.reading import as_mould
from raptor.parameters import CellParameters, require_parameters
from raptor.surrogate.command import load_surrogate
from raptor.surrogate.inference import Surrogate

NUMBERS = ("area_ratio", "width_ratio", "alignment", "anisotropy", "posts_lost")
BANDS = ("area_ratio_band95", "width_ratio_band95", "unusual")


def sweep(
    mould: Mould | str | Path,
    cells: Sequence[CellParameters],
    *,
    simulations: int = 0,
    surrogate: Surrogate | str | Path | None = None,
    accuracy: str = "standard",
    seed: int = 0,
    on_progress: Callable[[str], None] = lambda note: None,
) -> pd.DataFrame:
    """Tissues of one mould at several parameters: predicted with 95 % bands and, if asked for, simulated.

    Parameters
    ----------
    simulations : int
        Simulations of each point, with seeds from `seed` on, in as many layers as the surrogate has.
    surrogate : Surrogate, str, Path or None
        A surrogate or its folder; None for the shipped one.

    Returns
    -------
    DataFrame
        One row a point: the parameters; `NUMBERS` as predicted, with half widths of the ratios' bands and
        what is `unusual`; and as simulated, mean (`simulated_area_ratio`, ...) and standard deviation
        (`simulated_area_ratio_std`, ..., from two simulations on).

    Raises
    ------
    RaptorError
        If the mould cannot be read, or a parameter is out of the range that was trained on.
    """
    mould = as_mould(mould)
    if not isinstance(surrogate, Surrogate):
        surrogate = load_surrogate(surrogate)
    for point in cells:
        require_parameters(point).require_sampled("prediction")
    cast, rows = surrogate.cast(mould), []
    for point in cells:
        predicted = surrogate.examine(cast, point).numbers
        row = asdict(point) | {name: predicted[name] for name in (*NUMBERS, *BANDS)}
        if simulations:
            row |= _simulated(mould, point, surrogate.layers, accuracy, range(seed, seed + simulations))
        rows.append(row)
        on_progress(f"delta {point.delta:.3g}, kappas {point.kappa_nnn:.3g}, {point.kappa_nnnn:.3g}")
    return pd.DataFrame(rows)


def _simulated(
    mould: Mould, point: CellParameters, layers: int, accuracy: str, seeds: Sequence[int]
) -> dict[str, float]:
    """Mean of `NUMBERS` over seeds, and standard deviation where there are two or more."""
    tissues = [simulate(mould, point, layers, accuracy, seed) for seed in seeds]
    values = np.array([[getattr(tissue, name) for name in NUMBERS] for tissue in tissues], dtype=float)
    means = {f"simulated_{name}": value for name, value in zip(NUMBERS, values.mean(axis=0), strict=True)}
    if len(seeds) < 2:
        return means
    spread = values.std(axis=0, ddof=1)
    return means | {f"simulated_{name}_std": value for name, value in zip(NUMBERS, spread, strict=True)}
