"""What a search is asked for: cells, objectives, constraints, how moulds are made, and how far to search."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from raptor.core.blocks import Block, Positive, explain, read_yaml
from raptor.core.errors import RaptorError
from raptor.moulds.families import GAP, NARROWEST
from raptor.moulds.geojson import read_moulds
from raptor.moulds.geometry import SMALLEST_TETHER, Mould
from raptor.moulds.library.tissues import tissue
from raptor.moulds.reading import find_mould, read_mould
from raptor.moulds.tether_layouts import SMALLEST_POST, WALL
from raptor.parameters import CellParameters

MEASURES = {
    "alignment": "alignment of cells along an axis, -1 to 1",
    "anisotropy": "how far cells line up locally, whatever the direction, 0 to 1",
    "evenness": "1 less the coefficient of variation of the density that cells see",
    "tension": "mean tension of a cell, kappa0 l0",
    "peak_tension": "tension that 95 % of the cells stay below, kappa0 l0",
    "area": "area of the tissue",
    "length": "extent of the tissue along the mould's long side",
    "width": "extent of the tissue across it",
    "held": "chance that every tether is held",
    "mould_length": "long side of the mould",
    "mould_width": "short side of the mould",
    "cells": "number of cells",
    "tethers": "number of tethers",
    "distance": "distance from what the surrogate learnt; above 1 it is out of distribution",
}
"""What may be an objective or a constraint, by name."""
DIRECTED = ("alignment",)
LOCAL = ("alignment", "anisotropy", "evenness", "tension", "peak_tension")
"""Measures that can be taken in a region."""
DIMENSION = {"area": 2, "length": 1, "width": 1, "mould_length": 1, "mould_width": 1}
"""Power of a length in each measure that has a unit of length."""


class Measured(Block):
    """A measure, of the whole tissue or in a region."""

    measure: str = Field(description=f"one of {', '.join(MEASURES)}")
    axis: Literal["long", "short"] | float = Field(
        "long", description="of alignment: the mould's long or short side, or degrees from the long side"
    )
    region: tuple[float, float, float, float] | None = Field(
        None,
        description="x0, y0, x1, y1 from -1 to 1 along half of the mould's long and short side; null: all",
    )

    @model_validator(mode="after")
    def _measurable(self) -> Self:
        if self.measure not in MEASURES:
            raise ValueError(f"measure is '{self.measure}'; known are {', '.join(MEASURES)}")
        if self.axis != "long" and self.measure not in DIRECTED:
            raise ValueError(f"{self.measure} has no axis; only {', '.join(DIRECTED)} has")
        if self.region is not None:
            if self.measure not in LOCAL:
                raise ValueError(f"{self.measure} is of the whole tissue; {', '.join(LOCAL)} take a region")
            x0, y0, x1, y1 = self.region
            if not (-1 <= x0 < x1 <= 1 and -1 <= y0 < y1 <= 1):
                raise ValueError(
                    f"region is {list(self.region)}; give x0, y0, x1, y1 with -1 <= x0 < x1 <= 1, and so in y"
                )
        return self

    @property
    def label(self) -> str:
        """Its name in tables: the measure, with axis and region if they are not all."""
        axis = "" if self.axis == "long" else f"_{self.axis}"
        region = "" if self.region is None else "_in_" + "_".join(f"{v:g}" for v in self.region)
        return f"{self.measure}{axis}{region}"


class Objective(Measured):
    """A measure to be made large or small."""

    goal: Literal["maximise", "minimise"] = Field("maximise", description="maximise or minimise")

    @property
    def sign(self) -> int:
        """1 if it is to be small, -1 if large."""
        return 1 if self.goal == "minimise" else -1


class Constraint(Measured):
    """A measure to be kept within limits."""

    at_least: float | None = Field(None, description="lowest value allowed")
    at_most: float | None = Field(None, description="highest value allowed")

    @model_validator(mode="after")
    def _limited(self) -> Self:
        if self.at_least is None and self.at_most is None:
            raise ValueError(f"constraint on {self.measure} has no limit; give at_least or at_most")
        if None not in (self.at_least, self.at_most) and self.at_least > self.at_most:  # type: ignore[operator]
            raise ValueError(f"{self.measure}: at_least {self.at_least} is above at_most {self.at_most}")
        return self


class Process(Block):
    """What a way of making moulds can do; lengths in mm where `mm_per_l0` is given, otherwise in l0."""

    post: float | None = Field(
        None, gt=0, description=f"least diameter of a post, width of a bar; null: {2 * SMALLEST_POST} l0"
    )
    gap: float | None = Field(None, gt=0, description=f"least gap between two tethers; null: {GAP} l0")
    wall: float | None = Field(
        None, gt=0, description=f"least gap between tether and wall; null: {WALL} l0, the least allowed"
    )
    neck: float | None = Field(None, gt=0, description=f"least width of a neck; null: {NARROWEST} l0")
    corner: float = Field(0.0, ge=0, description="least radius of a corner")


class Budget(Block):
    """How far to search."""

    evaluations: int = Field(15_000, ge=1, description="moulds predicted")
    population: int = Field(100, ge=4, description="moulds of a generation")
    refined: float = Field(
        0.2, ge=0, le=0.9, description="share of the evaluations for refinement of the front by CMA-ES"
    )
    samples: Positive = Field(
        3, description="outcomes of each mould in the search: networks and images of D4, or samples"
    )
    caution: float = Field(
        1.0, ge=0, description="standard deviations over outcomes by which an objective counts as worse"
    )
    seed: int = Field(0, ge=0, lt=2**31, description="of the search")


class DesignSpec(Block):
    """A search for moulds."""

    tissue: str | None = Field(None, description="cells by the fit of a library tissue; or give `cells`")
    cells: dict[str, float] | None = Field(
        None, description="delta, kappa_nnn and kappa_nnnn; each overrides that of `tissue`"
    )
    objectives: tuple[Objective, ...] = Field(min_length=1, description="what to make large or small")
    constraints: tuple[Constraint, ...] = Field((), description="what to keep within limits")
    mm_per_l0: float | None = Field(
        None, gt=0, description="millimetres per l0; lengths here and in results are then in mm"
    )
    process: Process = Field(default_factory=Process, description="how moulds are made")
    mould_cells: tuple[Positive, Positive] = Field(
        (3000, 10_000), description="bounds of the number of cells in a mould"
    )
    tethers: tuple[int, int] = Field((1, 16), description="bounds of the number of tethers")
    search: Budget = Field(default_factory=Budget, description="how far to search")
    finalists: int = Field(8, ge=1, le=100, description="moulds of the front to simulate")
    simulations: int = Field(4, ge=0, description="of each finalist, with different seeds")
    accuracy: Literal["draft", "standard", "reference"] = Field("standard", description="of the simulations")
    compare: tuple[str, ...] = Field(
        (), description="moulds to measure beside: library names or files of one or more moulds"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        labels = [each.label for each in self.objectives]
        if len(set(labels)) < len(labels):
            raise ValueError("an objective is given twice; each measure may be one once")
        for name in ("mould_cells", "tethers"):
            low, high = getattr(self, name)
            if not 0 <= low <= high:
                raise ValueError(f"{name} is [{low}, {high}]; an ascending range from 0 is needed")
        if self.process.wall is not None and self.process.wall < WALL * self.unit * (1 - 1e-9):
            raise ValueError(
                f"process.wall is {self.process.wall:g}; at least {WALL * self.unit:.4g} ({WALL} l0) is "
                "needed, so that cells stand between tether and wall"
            )
        if self.least["post"] < 2 * SMALLEST_TETHER * (1 - 1e-9):
            least = 2 * SMALLEST_TETHER
            raise ValueError(
                f"process.post is {self.process.post:g}; at least {least * self.unit:.4g} ({least} l0) is "
                "needed to hold cells back"
            )
        if self.search.population > self.search.evaluations:
            raise ValueError(
                f"search.population is {self.search.population}, above search.evaluations "
                f"({self.search.evaluations}); lower it or search longer"
            )
        try:
            self.parameters.require_sampled("cells")
        except RaptorError as error:
            raise ValueError(str(error)) from None
        return self

    @cached_property
    def parameters(self) -> CellParameters:
        """Of the cells; raises as `tissue` and `CellParameters`."""
        given = dict(self.cells or {})
        known = CellParameters.__dataclass_fields__
        strange = sorted(set(given) - set(known))
        if strange:
            raise RaptorError(f"cells has '{strange[0]}'; known are {', '.join(known)}")
        if self.tissue is not None:
            return tissue(self.tissue).parameters(self.tissue, given)
        missing = [name for name in known if name not in given]
        if missing:
            raise RaptorError(f"cells: {', '.join(missing)} missing; give all of them, or a tissue")
        return CellParameters(**given)

    @property
    def unit(self) -> float:
        """The unit of lengths per l0: 1, or millimetres."""
        return self.mm_per_l0 or 1.0

    @property
    def steps(self) -> int:
        """Generations and simulations, about."""
        moulds = self.finalists + len(self.compare)
        return self.search.evaluations // self.search.population + moulds * self.simulations

    @cached_property
    def least(self) -> dict[str, float]:
        """The least lengths of the process by name, l0."""
        usual = {"post": 2 * SMALLEST_POST, "gap": GAP, "wall": WALL, "neck": NARROWEST, "corner": 0.0}
        given = {name: getattr(self.process, name) for name in usual}
        return {name: usual[name] if v is None else v / self.unit for name, v in given.items()}

    @property
    def measured(self) -> dict[str, Measured]:
        """Every measure of the objectives, then of the constraints, once each, by label."""
        return {each.label: each for each in (*self.objectives, *self.constraints)}


def read_spec(given: DesignSpec | Mapping[str, Any] | str | Path) -> DesignSpec:
    """A specification from a YAML file, or from the same as a dictionary.

    Raises
    ------
    RaptorError
        One sentence per fault; an unknown key is named with its nearest known one.
    """
    if isinstance(given, DesignSpec):
        return given
    content, where = (given, "spec") if isinstance(given, Mapping) else (read_yaml(Path(given)), str(given))
    try:
        return DesignSpec.model_validate(content)
    except ValidationError as error:
        raise RaptorError("; ".join(explain(error, where, DesignSpec))) from None


def with_changes(
    spec: DesignSpec, changes: Mapping[str, Any], search: Mapping[str, Any] = MappingProxyType({})
) -> DesignSpec:
    """A specification with other values of keys, and of keys of its block `search`, where not None.

    Raises
    ------
    RaptorError
        As `read_spec`.
    """
    content = spec.model_dump()
    content |= {name: value for name, value in changes.items() if value is not None}
    content["search"] |= {name: value for name, value in search.items() if value is not None}
    return read_spec(content)


def others(names: Sequence[str]) -> list[Mould]:
    """The moulds to compare with, of the library or of files of one or more.

    Raises
    ------
    RaptorError
        If one cannot be read.
    """
    found: list[Mould] = []
    for name in names:
        path = find_mould(name)
        found += read_moulds(path) if path.suffix == ".geojson" else [read_mould(path)]
    return found
