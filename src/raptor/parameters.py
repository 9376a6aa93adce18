"""Cell and matrix parameters, with their units and bounds.

Units: the nearest-neighbour bond length l0 and spring constant kappa0 are 1; everything is
dimensionless.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import Any

from raptor.core.errors import RaptorError

SHELL_DISTANCE = {1: 1.0, 2: sqrt(2.0), 3: sqrt(3.0), 4: 2.0}
"""Distance of the neighbour shells of the face-centred-cubic lattice, in l0."""

PARAMETERS = {
    "delta": "strength of the cell-matrix interaction",
    "kappa_nnn": "spring constant of the second kind of bond, in kappa0",
    "kappa_nnnn": "spring constant of the third kind of bond, in kappa0",
}
"""Names of the cell and matrix parameters, and what each means."""


@dataclass(frozen=True)
class Bounds:
    """A half-open interval [lower, upper)."""

    lower: float
    upper: float

    @property
    def middle(self) -> float:
        """Half way between both ends."""
        return (self.lower + self.upper) / 2

    @property
    def half(self) -> float:
        """Distance of either end from the middle."""
        return (self.upper - self.lower) / 2

    def __contains__(self, value: float) -> bool:
        return self.lower <= value < self.upper


# The paper's training box (section "Training Data").
DELTA = Bounds(0.05, 0.95)
KAPPA_NNN = Bounds(0.1, 0.71)
KAPPA_NNNN = Bounds(0.01, 0.5)
LAYERS = 7
"""Layers of a tissue where nothing else is said: those of the shipped surrogate."""
BOUNDS = {"delta": DELTA, "kappa_nnn": KAPPA_NNN, "kappa_nnnn": KAPPA_NNNN}
"""Of each parameter, in the order of `CellParameters`."""


def largest_kappa_nnnn(kappa_nnn: float) -> float:
    """Upper bound of kappa_nnnn at a given kappa_nnn, in kappa0 (paper, "Training Data")."""
    return kappa_nnn / sqrt(2.0)


@dataclass(frozen=True)
class CellParameters:
    """Parameters of the cells and the matrix.

    Parameters
    ----------
    delta : float
        Strength of the cell-matrix interaction, dimensionless, 0 <= delta < 1.
    kappa_nnn, kappa_nnnn : float
        Spring constants of the second and third kind of bond, in kappa0, each in [0, 1].

    Raises
    ------
    RaptorError
        If a value is outside the range that the model can simulate.
    """

    delta: float
    kappa_nnn: float
    kappa_nnnn: float

    def __post_init__(self) -> None:
        if not (isfinite(self.delta) and 0 <= self.delta < 1):
            raise RaptorError(f"delta is {self.delta}; the model allows 0 <= delta < 1")
        for name in ("kappa_nnn", "kappa_nnnn"):
            value = getattr(self, name)
            if not (isfinite(value) and 0 <= value <= 1):
                raise RaptorError(f"{name} is {value}; the model allows 0 <= {name} <= 1")

    def require_sampled(self, where: str) -> "CellParameters":
        """Return self if inside the paper's box (closed, for the edge set), else raise.

        Raises
        ------
        RaptorError
            If a parameter lies outside the box used for sampling, prediction and fitting.
        """
        for name, bounds in BOUNDS.items():
            value = getattr(self, name)
            if not bounds.lower <= value <= bounds.upper:
                raise RaptorError(
                    f"{where}: {name} is {value}; it must lie between {bounds.lower} and "
                    f"{bounds.upper}, the range covered by training"
                )
        largest = largest_kappa_nnnn(self.kappa_nnn)
        if self.kappa_nnnn > largest * (1 + 1e-12):
            raise RaptorError(
                f"{where}: kappa_nnnn is {self.kappa_nnnn}, above kappa_nnn/sqrt(2) = "
                f"{largest:.4g}; lower kappa_nnnn or raise kappa_nnn"
            )
        return self


def require_parameters(cells: CellParameters) -> CellParameters:
    """Return the argument if it is CellParameters, else raise.

    Raises
    ------
    RaptorError
        If it is anything else.
    """
    if not isinstance(cells, CellParameters):
        raise RaptorError(
            f"cells are of type {type(cells).__name__}; give raptor.CellParameters(delta, kappa_nnn, "
            "kappa_nnnn), or the fit of a tissue: raptor.tissue(name).fit"
        )
    return cells


@dataclass(frozen=True)
class NetworkModel:
    """The choices that the paper leaves open (see docs of each key in config/README.md).

    Parameters
    ----------
    layers : int
        Cell layers between the mould floor and the fill height.
    shells : tuple of int
        Neighbour shells of kappa0, kappa_nnn and kappa_nnnn, the first always 1.
    tension : str
        "hooke": k (|l| - L'), the derivative of the energy; "literal": k L', the paper's formula.
    """

    layers: int
    shells: tuple[int, int, int] = (1, 2, 3)
    tension: str = "hooke"

    def __post_init__(self) -> None:
        if not 1 <= self.layers <= 64:
            raise RaptorError(f"layers is {self.layers}; 1 to 64 are allowed")
        if self.shells not in ((1, 2, 3), (1, 2, 4), (1, 3, 4)):
            raise RaptorError(
                f"shells is {list(self.shells)}; allowed are [1, 2, 3], [1, 2, 4] and [1, 3, 4]"
            )
        if self.tension not in ("hooke", "literal"):
            raise RaptorError(f"tension is '{self.tension}'; allowed are hooke and literal")

    @classmethod
    def configured(cls, content: Mapping[str, Any]) -> "NetworkModel":
        """From a configuration's layers, shells and tension."""
        return cls(content["layers"], tuple(content["shells"]), content["tension"])

    @property
    def height(self) -> float:
        """Fill height above the mould floor, in l0."""
        return self.layers / sqrt(2.0)
