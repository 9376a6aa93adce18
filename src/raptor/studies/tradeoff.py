"""Speed against accuracy: cost and errors of each way to a tissue's fields."""

import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import pandas as pd
import shapely
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, model_validator

from raptor.condor.accuracy import accuracy_named
from raptor.condor.simulate import Tissue, simulate
from raptor.core.blocks import Block, Name
from raptor.fields.shape import shape_ratios
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters, NetworkModel
from raptor.raster import rasterise

if TYPE_CHECKING:  # tables and figures do not wait for torch
    from raptor.surrogate.inference import Surrogate

REFERENCES = 4  # reference runs with different seeds, to measure the spread
SURROGATE = "surrogate"


@dataclass(frozen=True)
class Variant:
    """The `standard` run with another model or raster; None leaves a property unchanged."""

    layers: int | None = None
    shells: tuple[int, int, int] | None = None
    pixels: int | None = None


def variant_named(method: str) -> Variant | None:
    """The variant named by a method: "3 layers", "shells 1 2 4", "64 pixels"; None for any other name.

    Raises
    ------
    RaptorError
        If there is no such network of cells.
    """
    if found := re.fullmatch(r"([1-9]\d?) layers", method):
        NetworkModel(int(found[1]))
        return Variant(layers=int(found[1]))
    if found := re.fullmatch(r"shells (\d) (\d) (\d)", method):
        shells = (int(found[1]), int(found[2]), int(found[3]))
        NetworkModel(1, shells)
        return Variant(shells=shells)
    if found := re.fullmatch(r"([1-9]\d{1,3}) pixels", method):
        return Variant(pixels=int(found[1]))
    return None


def _method(name: str) -> str:
    if name != SURROGATE and variant_named(name) is None:
        accuracy_named(name)
    return name


class Case(Block):
    """A mould and parameters to compare on."""

    mould: str = Field(description="a library mould by name, or a mould file")
    delta: float = Field(description="cell-matrix interaction")
    kappa_nnn: float = Field(description="second-shell spring constant, kappa0")
    kappa_nnnn: float = Field(description="third-shell spring constant, kappa0")
    layers: int | None = Field(None, ge=1, le=64, description="number of layers; null: the key layers")

    @model_validator(mode="after")
    def _allowed(self) -> "Case":
        CellParameters(self.delta, self.kappa_nnn, self.kappa_nnnn)
        return self


CASES = {
    "middle": Case(mould="small_rectangle", delta=0.5, kappa_nnn=0.5, kappa_nnnn=0.3),
    "soft": Case(mould="small_rectangle", delta=0.9, kappa_nnn=0.1, kappa_nnnn=0.01),
}


class Tradeoff(Block):
    """The comparison of speed and accuracy."""

    methods: tuple[Annotated[str, AfterValidator(_method)], ...] = Field(
        ("draft", "standard", "anneal-1e3", SURROGATE),
        description="methods compared with the reference: accuracies; surrogate; or the standard run with "
        "another model or raster, such as '3 layers', 'shells 1 2 4', '64 pixels'",
    )
    cases: dict[Name, Case] = Field(
        default_factory=lambda: dict(CASES),
        description="moulds and parameters to compare on, by name; empty: no comparison",
    )

    @property
    def rasters(self) -> list[int]:
        """Sides of the other rasters compared."""
        variants = map(variant_named, self.methods)
        return [found.pixels for found in variants if found is not None and found.pixels is not None]

    @property
    def annealed(self) -> tuple[str, str] | None:
        """The case and method that show folding: the largest delta, the last anneal."""
        anneals = [method for method in self.methods if method.startswith("anneal")]
        if not anneals or not self.cases:
            return None
        return max(self.cases, key=lambda name: self.cases[name].delta), anneals[-1]


@dataclass(frozen=True)
class Reference:
    """Reference runs of one mould with different seeds.

    Parameters
    ----------
    stacks : list of ndarray (8, y, x)
        Fields of each run.
    shapes : ndarray (runs, 2)
        A/A0 and w/w0 of each run.
    """

    stacks: list[NDArray[np.float64]]
    shapes: NDArray[np.float64]

    @property
    def spread(self) -> NDArray[np.float64]:
        """Seed-to-seed spread of each field (8,), the error of the best prediction of a single run.

        Root mean square over pixels of the difference of two runs, over sqrt 2, averaged over pairs.
        """
        pairs = [_distance(a, b) for a, b in combinations(self.stacks, 2)]
        return np.asarray(np.mean(pairs, axis=0) / np.sqrt(2))

    def field_error(self, fields: NDArray[np.floating], own: int | None = None) -> NDArray[np.float64]:
        """Distance of fields (8, y, x) to single other runs, in units of the spread (8,).

        The mean of many runs, the best prediction, scores 1; another run scores sqrt 2. `own` is the
        number of the reference run to which the fields belong, if any.
        """
        others = [stack for number, stack in enumerate(self.stacks) if number != own]
        return np.asarray(np.mean([_distance(fields, s) for s in others], axis=0) / self.spread)

    def shape_error(self, shape: NDArray[np.float64], own: int | None = None) -> NDArray[np.float64]:
        """Differences of A/A0 and w/w0 from the mean of other reference runs, (2,)."""
        others = [found for number, found in enumerate(self.shapes) if number != own]
        return np.asarray(shape - np.mean(others, axis=0))


@dataclass(frozen=True)
class Trial:
    """A case, ready to run."""

    name: str
    mould: Mould
    parameters: CellParameters
    model: NetworkModel
    pixels: int
    seed: int

    @classmethod
    def of(cls, content: dict[str, Any], mould: Mould) -> "Trial":
        """The trial of a configuration's `trial`."""
        return cls(
            content["name"],
            mould,
            CellParameters(content["delta"], content["kappa_nnn"], content["kappa_nnnn"]),
            NetworkModel.configured(content),
            content["pixels"],
            content["seed"] % 2**31,
        )

    def simulate(self, accuracy: str, seed: int | None = None) -> Tissue:
        """One run at an accuracy, with the case's seed or another."""
        seed = self.seed if seed is None else seed
        return simulate(self.mould, self.parameters, self.model, accuracy, seed)

    def fields(self, s: Tissue, pixels: int | None = None) -> NDArray[np.float64]:
        """Its fields (8, y, x)."""
        return rasterise(s.positions, s.orientation, s.tension, pixels or self.pixels)

    def shape(self, fields: NDArray[np.floating]) -> NDArray[np.float64]:
        """A/A0 and w/w0 of fields (8, y, x), of any raster."""
        return shape_ratios(fields[0], CastMould(self.mould, self.model.layers, fields.shape[-1]))


def compare(
    trial: Trial,
    methods: Sequence[str],
    surrogate: "Surrogate | None" = None,
    on_progress: Callable[[str], None] = lambda what: None,
) -> pd.DataFrame:
    """One row per method: cost, energy, and errors of fields and shapes against reference runs.

    `energy_above_best` is the relative excess of the energy of bonds, walls and contacts over the lowest of
    any run of the same network without inverted bonds. `core_seconds` is the processor time of the run, with
    kernels already compiled and loaded.
    """
    accuracies = [name for name in methods if name != SURROGATE and variant_named(name) is None]
    variants = {name: found for name in methods if (found := variant_named(name)) is not None}
    _warm_up(accuracies)
    runs = []
    for offset in range(1, REFERENCES + 1):
        runs.append(_timed(partial(trial.simulate, "reference", trial.seed + offset)))
        on_progress(f"reference, seed {offset}")
    stacks = [trial.fields(s) for s, _ in runs]
    shapes = np.array([trial.shape(stack) for stack in stacks])
    reference = Reference(stacks, shapes)
    rows = [
        _row(trial, reference, f"reference, seed {own + 1}", stacks[own], seconds, own) | _outcome(s)
        for own, (s, seconds) in enumerate(runs)
    ]
    for method in accuracies:
        s, seconds = _timed(partial(trial.simulate, method))
        rows.append(_row(trial, reference, method, trial.fields(s), seconds) | _outcome(s))
        on_progress(method)
    totals = [row["energy"] + row["wall_energy"] for row in rows]
    intact = [t for t, row in zip(totals, rows, strict=True) if row["inverted_fraction"] == 0]
    best = min(intact, default=np.nan)
    for total, row in zip(totals, rows, strict=True):
        row["energy_above_best"] = total / best - 1 if best else np.nan
    for name, variant in variants.items():
        rows.append(_of_variant(trial, reference, name, variant))
        on_progress(name)
    if surrogate is not None:
        predicted, seconds = _timed(partial(surrogate.predict, trial.mould, [trial.parameters]))
        shape = surrogate.ratios(predicted[0, 0], surrogate.cast(trial.mould))
        row = _row(trial, reference, SURROGATE, predicted[0], seconds)
        row["area_error"], row["width_error"] = reference.shape_error(shape)
        rows.append(row)
    spread = {"density_spread": reference.spread[0], "area_spread": shapes[:, 0].std(ddof=1)}
    spread["width_spread"] = shapes[:, 1].std(ddof=1)
    table = pd.DataFrame(rows).assign(**spread)
    return table.fillna({"cells": runs[0][0].cells})


def _warm_up(accuracies: Sequence[str]) -> None:
    """Load the kernels of every precision."""
    gel = Mould(shapely.box(-2, -2, 2, 2), name="gel")
    for name in {"standard", *("standard-float32" for method in accuracies if method.endswith("-float32"))}:
        simulate(gel, CellParameters(0.5, 0.5, 0.3), NetworkModel(2), name)


def _of_variant(trial: Trial, reference: Reference, name: str, variant: Variant) -> dict[str, Any]:
    """The `standard` run of a variant, its fields in cells of the trial's layers, on the trial's raster."""
    model = replace(
        trial.model,
        layers=variant.layers or trial.model.layers,
        shells=variant.shells or trial.model.shells,
    )
    other = replace(trial, model=model, pixels=variant.pixels or trial.pixels)
    s, seconds = _timed(partial(other.simulate, "standard"))
    fields, rastering = _timed(partial(other.fields, s))
    fields = fields * trial.model.layers / model.layers
    row = _row(trial, reference, name, _resampled(fields, trial.pixels), seconds) | _outcome(s)
    row["area_error"], row["width_error"] = reference.shape_error(trial.shape(fields))
    return row | {"raster_seconds": rastering}


def _resampled(fields: NDArray[np.float64], pixels: int) -> NDArray[np.float64]:
    """Fields (8, y, x) on another raster; sums over the image are preserved."""
    before = fields.shape[-1]
    if before < pixels:
        factor = pixels // before
        return np.asarray(np.kron(fields, np.ones((1, factor, factor))) / factor**2)
    factor = before // pixels
    return np.asarray(fields.reshape(len(fields), pixels, factor, pixels, factor).sum(axis=(2, 4)))


def _timed(work: Callable[[], Any]) -> tuple[Any, float]:
    started = time.process_time()
    return work(), time.process_time() - started


def _outcome(s: Tissue) -> dict[str, Any]:
    return {
        "energy": s.energy,
        "wall_energy": s.wall_energy + s.contact_energy,
        "cells": s.cells,
        "inverted_fraction": s.inverted_fraction,
        "converged": s.converged,
        "gradient_evaluations": s.gradient_evaluations,
    }


def _row(
    trial: Trial,
    reference: Reference,
    method: str,
    fields: NDArray[np.floating],
    seconds: float,
    own: int | None = None,
) -> dict[str, Any]:
    errors = reference.field_error(fields, own)
    area_error, width_error = reference.shape_error(trial.shape(fields), own)
    return {
        "case": trial.name,
        "method": method,
        "core_seconds": seconds,
        "density_error": float(errors[0]),
        "tension_error": float(errors[1]),
        "sxsx_error": float(errors[2]),
        "area_error": float(area_error),
        "width_error": float(width_error),
    }


def _distance(a: NDArray[np.floating], b: NDArray[np.floating]) -> NDArray[np.float64]:
    """Root mean square over pixels of the difference of two stacks, per field (8,)."""
    return np.asarray(np.sqrt(((a - b) ** 2).mean(axis=(1, 2))))


def summarise(table: pd.DataFrame) -> pd.DataFrame:
    """One row per method, over its cases: geometric mean of costs, medians and extremes of errors."""
    named = table.assign(method=table["method"].str.replace(r", seed \d+", "", regex=True))
    groups = named.groupby("method", sort=False)
    spreads = {
        "cases": groups["case"].nunique(),
        "core_seconds": groups["core_seconds"].agg(lambda x: float(np.exp(np.log(x).mean()))),
        "microseconds_a_cell": 1e6
        * (named["core_seconds"] / named["cells"]).groupby(named["method"], sort=False).median(),
        "energy_above_best": groups["energy_above_best"].median(),
        "density_error": groups["density_error"].median(),
        "density_error_max": groups["density_error"].max(),
        "sxsx_error": groups["sxsx_error"].median(),
        "area_error": groups["area_error"].agg(lambda x: x.abs().mean()),
        "area_error_max": groups["area_error"].agg(lambda x: x.abs().max()),
        "width_error": groups["width_error"].agg(lambda x: x.abs().mean()),
        "width_error_max": groups["width_error"].agg(lambda x: x.abs().max()),
        "inverted_fraction_max": groups["inverted_fraction"].max(),
    }
    return pd.DataFrame(spreads).reset_index()
