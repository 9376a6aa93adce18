"""A fitted tissue: its parameters, ratios and intervals."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raptor.fitting.least_squares import Minimum
from raptor.fitting.outline import Outline
from raptor.fitting.tables import write_fit
from raptor.fitting.targets import Target
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters


@dataclass(frozen=True)
class FittedTissue:
    """A fit, as returned by `fit`.

    Parameters
    ----------
    mould : Mould
    target : Target or Outline
        What was measured.
    by : str
        "surrogate" or "simulator".
    layers : int
    minimum : Minimum
        The smallest residual sum of squares found.
    area_ratio, width_ratio : float
        Of the tissue there.
    intervals : dict of (float, float)
        Ends of the 95 % interval of each parameter; empty if unknown.
    reachable : bool or None
        Whether any parameters reproduce the measurement on this mould; None if unknown.
    posterior : mapping
        The posterior in numbers, as from `fitting.summarise`; empty if there is none.
    density : ndarray (y, x)
        Of the tissue there, per pixel.
    threshold : float
        Density per pixel above which there is tissue.
    """

    mould: Mould
    target: Target | Outline
    by: str
    layers: int
    minimum: Minimum
    area_ratio: float
    width_ratio: float
    intervals: dict[str, tuple[float, float]]
    reachable: bool | None
    posterior: Mapping[str, Any]
    density: NDArray[np.floating]
    threshold: float

    @property
    def parameters(self) -> CellParameters:
        """The best-fitting parameters."""
        return self.minimum.parameters

    @property
    def rank(self) -> int:
        """How many combinations of the three parameters the measurement determines."""
        return self.minimum.rank

    @property
    def rss(self) -> float:
        """Residual sum of squares: of ratios, or the mean square distance to an outline, l0^2."""
        return self.minimum.rss

    @property
    def distance(self) -> float | None:
        """Root mean square distance to the measured outline, l0; None for a fit to ratios."""
        return float(np.sqrt(self.rss)) if isinstance(self.target, Outline) else None

    @property
    def measured(self) -> Target:
        """The measured ratios; None if not measured."""
        return self.target if isinstance(self.target, Target) else Target(None, None)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Measured and fitted ratios, as `plotting.fit_figure` takes them."""
        ratios = {"area_ratio": self.area_ratio, "width_ratio": self.width_ratio}
        return [{"source": "measured", **asdict(self.measured)}, {"source": self.by, **ratios}]

    @property
    def numbers(self) -> dict[str, float | int | bool | str | None]:
        """The fit by name, without nesting."""
        ends = {
            f"{name}_{end}": value
            for name, interval in self.intervals.items()
            for end, value in zip(("lower", "upper"), interval, strict=True)
        }
        about = {"mould": self.mould.name, "by": self.by, "layers": self.layers}
        return {**about, **asdict(self.parameters), **self._fitted, **ends, "reachable": self.reachable}

    def as_json(self) -> dict[str, Any]:
        """As stored in a file."""
        ends = {name: {"lower": low, "upper": high} for name, (low, high) in self.intervals.items()}
        content = {
            "mould": self.mould.name,
            "by": self.by,
            "layers": self.layers,
            "target": asdict(self.measured),
            "fit": {"parameters": asdict(self.parameters), **self._fitted},
            "intervals": ends,
            "reachable": self.reachable,
        }
        return content | ({"posterior": dict(self.posterior)} if self.posterior else {})

    def save(self, path: str | Path) -> None:
        """Write the fit as JSON; numbers that are not finite become null."""
        write_fit(Path(path), self.as_json())

    @property
    def _fitted(self) -> dict[str, float | int]:
        """What the fit ended with."""
        apart = {} if self.distance is None else {"distance": self.distance}
        return {
            "area_ratio": self.area_ratio, "width_ratio": self.width_ratio, "rss": self.rss,
            "rank": self.rank, "evaluations": self.minimum.evaluations, **apart,
        }  # fmt: skip

    def __str__(self) -> str:
        parts = []
        for name, value in asdict(self.parameters).items():
            known = " ({:.2f} to {:.2f})".format(*self.intervals[name]) if name in self.intervals else ""
            parts.append(f"{name} {value:.3f}{known}")
        apart = f"rss {self.rss:.1e}" if self.distance is None else f"outlines {self.distance:.2f} l0 apart"
        said = f"{', '.join(parts)}; A/A0 {self.area_ratio:.3f}, w/w0 {self.width_ratio:.3f}, {apart}"
        if self.rank < 3:
            said += (
                f"\nonly {self.rank} combinations of the three parameters are determined: other parameters "
                "fit equally well"
            )
        if self.reachable is False:
            said += "\nno parameters reproduce the measurement on this mould, so do not trust the fit"
        return said
