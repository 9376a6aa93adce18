"""Measurements on a tissue beyond its area and central width, with their standard errors.

The errors are assumptions, to be replaced by a laboratory's own: of ratios as for A/A0, of mean orientation
as from polarised light or a stained section, of tension a tenth of its value (its unit, kappa0 l0, must be
known too), of thickness as from focusing through the gel.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raptor.condor.simulate import Tissue
from raptor.fields.directors import alignment
from raptor.fields.shape import section_ratio, shape_ratios
from raptor.fitting.targets import RATIOS
from raptor.moulds.cast import CastMould
from raptor.symmetry import FIELDS

STATIONS = (0.25, 0.5, 0.75)  # of half the long side, from the centre
WIDTHS = tuple(f"width_{round(100 * place)}" for place in STATIONS)
SEEN = (*RATIOS, *WIDTHS, "alignment", "upright", "tension")
"""Quantities that fields show, in the order of `seen`."""


@dataclass(frozen=True)
class Candidate:
    """A measurement that could be made.

    Parameters
    ----------
    name, label : str
        For files and figures.
    parts : tuple of str
        Measured quantities, of `SEEN` or "thickness".
    error : float
        Standard error of each part, over its value if `relative`.
    """

    name: str
    label: str
    parts: tuple[str, ...]
    error: float
    relative: bool = False


CANDIDATES = (
    Candidate("area_ratio", "area $A/A_0$", ("area_ratio",), 0.01),
    Candidate("width_ratio", "central width $w/w_0$", ("width_ratio",), 0.01),
    Candidate("outline", "shape: widths along the tissue", WIDTHS, 0.01),
    Candidate("alignment", "alignment along the mould", ("alignment",), 0.02),
    Candidate("upright", "orientation out of the plane", ("upright",), 0.02),
    Candidate("tension", "mean tension", ("tension",), 0.1, relative=True),
    Candidate("thickness", "thickness", ("thickness",), 0.02),
)
"""All candidates."""


def seen(fields: NDArray[np.floating], cast: CastMould, threshold: float) -> NDArray[np.float64]:
    """The quantities `SEEN` of a tissue's fields (8, y, x), (8,).

    Widths are w/w0 on pairs of sections at `STATIONS` to both sides of the centre. alignment is
    `directors.alignment`, upright the mean over cells of (s.z)^2, tension the mean over cells, kappa0 l0.
    """
    density = fields[0]
    sums = dict(zip(FIELDS, fields.sum(axis=(1, 2), dtype=np.float64), strict=True))
    widths = [section_ratio(density, cast, cast.sections((-p, p)), threshold) for p in STATIONS]
    means = [sums[name] / sums["density"] for name in ("szsz", "tension")]
    return np.array([*shape_ratios(density, cast, threshold), *widths, alignment(fields, cast), *means])


def thickness_ratio(simulation: Tissue) -> float:
    """Thickness of a simulated tissue over that of the gel as cast, as standard deviations of cell heights.

    NaN for a single layer.
    """
    cast = float(simulation.sites[:, 2].std())
    return float(simulation.positions[:, 2].std()) / cast if cast > 0 else float("nan")
