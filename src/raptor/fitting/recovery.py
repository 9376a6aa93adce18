"""Recovery of known parameters from a simulated tissue, by its ratios and by its outline."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from raptor.fields.shape import shape_ratios
from raptor.fitting.least_squares import STARTS, minimise
from raptor.fitting.outline import OUTLINE_ERROR, deviations, outline_measure, outline_of
from raptor.fitting.targets import PARAMETERS, Target, as_array, surrogate_densities, surrogate_measure
from raptor.moulds.geometry import Mould
from raptor.parameters import BOUNDS, CellParameters
from raptor.raster import density_threshold

if TYPE_CHECKING:  # tables and figures do not wait for torch
    from raptor.surrogate.inference import Surrogate

SEARCHES = 3  # from different starting points: in a flat valley they end in different places


def recover(
    surrogate: "Surrogate",
    mould: Mould,
    density: NDArray[np.floating],
    truth: CellParameters,
    *,
    seed: int,
    starts: int = STARTS,
) -> dict[str, Any]:
    """Fit a tissue of known parameters from its density (y, x): by two ratios, and by its outline.

    `error` of each is the root mean square error over parameters and searches, in parts of their ranges.
    """
    cast = surrogate.cast(mould)
    measure, fine = (surrogate_measure(surrogate, cast, averaged=averaged) for averaged in (False, True))
    target = Target(*map(float, shape_ratios(density, cast)))
    threshold = density_threshold(surrogate.layers, density.shape[-1])
    outline = outline_of(density, threshold)
    coarse, apart = (
        outline_measure(surrogate_densities(surrogate, cast, averaged=averaged), outline, surrogate.threshold)
        for averaged in (False, True)
    )
    seeds = [seed + number for number in range(1, SEARCHES + 1)]
    by_ratios = [minimise(measure, target.residuals, starts=starts, seed=each, fine=fine) for each in seeds]
    by_outline = [minimise(coarse, np.asarray, starts=starts, seed=each, fine=apart) for each in seeds]
    nearest, best = (min(fits, key=lambda found: found.rss) for fits in (by_ratios, by_outline))
    errors = deviations(apart, best, outline, OUTLINE_ERROR)
    return {
        "truth": asdict(truth),
        "target": asdict(target),
        "ratios": _outcome([found.parameters for found in by_ratios], truth)
        | {"rank": nearest.rank, "rss": nearest.rss},
        "outline": _outcome([found.parameters for found in by_outline], truth)
        | {
            "rank": best.rank,
            "distance": float(np.sqrt(best.rss)),
            "std": dict(zip(PARAMETERS, map(float, errors), strict=True)),
        },
    }


def _outcome(found: Sequence[CellParameters], truth: CellParameters) -> dict[str, Any]:
    """Fits and their distance from the true parameters."""
    widths = np.array([bounds.upper - bounds.lower for bounds in BOUNDS.values()])
    errors = (as_array(found) - as_array([truth])) / widths
    return {"fits": [asdict(each) for each in found], "error": float(np.sqrt((errors**2).mean()))}
