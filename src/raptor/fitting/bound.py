"""Tissues of which only delta is known, such as those at whose bound the paper's search ended."""

from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
import pandas as pd

from raptor.fitting.simulator import Simulator
from raptor.fitting.targets import RATIOS, parameters_at
from raptor.moulds.geometry import Mould

CORNERS = ((0.0, 0.0), (0.0, 1.0), (0.5, 0.5), (1.0, 0.0), (1.0, 1.0))
"""Corners and centre of the kappas' part of the unit cube."""


def simulate_at_delta(
    simulator: Simulator, mould: Mould, delta: float, on_progress: Callable[[str], None] = lambda note: None
) -> pd.DataFrame:
    """Area and width ratio at one delta over the range of spring constants: its corners and its centre."""
    rows = []
    for corner in CORNERS:
        parameters = replace(parameters_at(np.array([0.0, *corner])), delta=delta)
        made = simulator.run(mould, parameters)
        row = asdict(parameters) | dict(zip(RATIOS, simulator.ratios(made, mould), strict=True))
        rows.append(row | {"converged": made.converged, "inverted_fraction": made.inverted_fraction})
        on_progress(str(made))
    return pd.DataFrame(rows)
