"""A fitted tissue: its parameters, ratios and intervals."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from raptor.condor.simulate import Tissue
from raptor.fitting.least_squares import Minimum
from raptor.fitting.outline import Outline, distances
from raptor.fitting.tables import write_fit
from raptor.fitting.targets import PARAMETERS, RATIOS, Target
from raptor.moulds.geometry import Mould
from raptor.parameters import BOUNDS, CellParameters
from raptor.surrogate.bands import NORMAL
from raptor.surrogate.prediction import Prediction


@dataclass(frozen=True)
class FittedTissue:
    """A fit, as returned by `fit`.

    Parameters
    ----------
    mould : Mould
    target : Target or Outline
        What was measured.
    by : str
        "surrogate", "corrected" (by simulations) or "simulator".
    layers : int
    simulations : int
        Made for it.
    minimum : Minimum
        The smallest residual sum of squares found.
    tissue : Tissue or Prediction
        At the fit, simulated unless the surrogate alone made it.
    intervals : dict of (float, float)
        Ends of the 95 % interval of each parameter; empty if unknown.
    posterior : mapping
        The posterior in numbers, as from `fitting.summarise`; empty if there is none.
    draws : ndarray (n, 3)
        Parameters drawn from the posterior.
    """

    mould: Mould
    target: Target | Outline
    by: str
    layers: int
    simulations: int
    minimum: Minimum
    tissue: Tissue | Prediction
    intervals: dict[str, tuple[float, float]]
    posterior: Mapping[str, Any]
    draws: NDArray[np.float64]

    @property
    def area_ratio(self) -> float:
        """A/A0 of the tissue at the fit."""
        return self.tissue.area_ratio

    @property
    def width_ratio(self) -> float:
        """w/w0 of the tissue at the fit."""
        return self.tissue.width_ratio

    @property
    def reachable(self) -> bool | None:
        """Whether any parameters reproduce the measurement on this mould; None if unknown."""
        return self.posterior.get("reachable")

    @property
    def open(self) -> list[str]:
        """Parameters that the measurement leaves open: more than half of what was unknown before is left.

        Compared are the interval, taken for that of a normal error, and the deviation of a uniform
        distribution over the parameter's range. All of them where there are no intervals.
        """
        return [
            name
            for name in PARAMETERS
            if name not in self.intervals
            or np.ptp(self.intervals[name]) / (2 * NORMAL) > BOUNDS[name].half / 12**0.5
        ]

    def apart(self, tissue: shapely.Geometry) -> float:
        """Root mean square distance from a measured outline (l0) to that of the tissue at the fit, l0."""
        fields = self.tissue.to_dataset()
        found = distances(
            Outline.along(tissue), fields["density"].to_numpy(), float(fields.attrs["threshold"])
        )
        return float(np.sqrt(np.mean(found**2)))

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
    def numbers(self) -> dict[str, float | int | bool | str | None]:
        """The fit by name, without nesting."""
        ends = {
            f"{name}_{end}": value
            for name, interval in self.intervals.items()
            for end, value in zip(("lower", "upper"), interval, strict=True)
        }
        about = {"mould": self.mould.name, "by": self.by, "layers": self.layers}
        about |= {"simulations": self.simulations}
        return {**about, **asdict(self.parameters), **self._fitted, **ends, "reachable": self.reachable}

    def as_json(self) -> dict[str, Any]:
        """As stored in a file."""
        ends = {name: {"lower": low, "upper": high} for name, (low, high) in self.intervals.items()}
        content = {
            "mould": self.mould.name,
            "by": self.by,
            "layers": self.layers,
            "simulations": self.simulations,
            "target": asdict(self.measured),
            "fit": {"parameters": asdict(self.parameters), **self._fitted},
            "intervals": ends,
            "open": self.open,
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

    @property
    def table(self) -> list[tuple[str, str]]:
        """What was found, and what each number rests on, by name."""
        rows = []
        for name, value in asdict(self.parameters).items():
            said = f"{value:.3f}"
            if name in self.intervals:
                said += ", 95 % {:.2f} to {:.2f}; ".format(*self.intervals[name])
                said += ("left open by " if name in self.open else "from ") + self._source
            rows.append((name, said))
        pairs = zip(("A/A0", "w/w0"), RATIOS, asdict(self.measured).values(), strict=True)
        for label, name, measured in pairs:
            given = "" if measured is None else f"{measured:.3f} measured, "
            rows.append((label, f"{given}{getattr(self, name):.3f} {self._model}"))
        if self.distance is not None:
            rows.append(("outlines", f"{self.distance:.2f} l0 apart"))
        return rows

    @property
    def warning(self) -> str:
        """Why the fit is not to be trusted; empty where it may be."""
        if self.reachable is False:
            return "no parameters reproduce the measurement on this mould, so do not trust the fit"
        if self.rank < 3 and not self.intervals:
            return (
                f"the measurement responds to only {self.rank} combinations of the three parameters: other "
                "parameters fit equally well"
            )
        return ""

    @property
    def _source(self) -> str:
        """What the parameters rest on."""
        if isinstance(self.target, Outline):
            return "the outline"
        given = [
            label
            for label, value in zip(("A/A0", "w/w0"), asdict(self.target).values(), strict=True)
            if value is not None
        ]
        return " and ".join(given)

    @property
    def _model(self) -> str:
        """What the ratios at the fit rest on."""
        if self.by == "surrogate":
            return "predicted by the surrogate alone"
        return f"simulated, after {self.simulations} simulations"

    def __str__(self) -> str:
        said = [f"{name:<10}  {value}" for name, value in self.table]
        return "\n".join(["", *said, *filter(None, [self.warning])])
