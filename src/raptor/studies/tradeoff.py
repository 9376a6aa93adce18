"""Speed against accuracy: what each way to a tissue's fields costs and gets wrong."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import shapely
from numpy.typing import NDArray

from raptor.condor.simulate import Tissue, simulate
from raptor.fields.shape import shape_ratios
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters, NetworkModel
from raptor.raster import rasterise

if TYPE_CHECKING:  # tables and figures do not wait for torch
    from raptor.surrogate.inference import Surrogate


@dataclass(frozen=True)
class Reference:
    """Several reference runs of one mould, of different seeds, and what they agree on.

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
        """Seed-to-seed spread of each field (8,): what no prediction of a single run can beat.

        Root mean square over pixels of the difference of two runs, over sqrt 2, averaged over
        pairs.
        """
        pairs = [_distance(a, b) for a, b in combinations(self.stacks, 2)]
        return np.asarray(np.mean(pairs, axis=0) / np.sqrt(2))

    def field_error(self, fields: NDArray[np.floating], own: int | None = None) -> NDArray[np.float64]:
        """Distance of fields (8, y, x) to single other runs, in units of the spread (8,).

        The mean of very many runs, the best of predictions, scores 1; another run scores sqrt 2.
        `own` is the number of the reference run that the fields are of.
        """
        others = [stack for number, stack in enumerate(self.stacks) if number != own]
        return np.asarray(np.mean([_distance(fields, s) for s in others], axis=0) / self.spread)

    def shape_error(self, shape: NDArray[np.float64], own: int | None = None) -> NDArray[np.float64]:
        """A/A0 and w/w0 above the mean of other reference runs, (2,)."""
        others = [found for number, found in enumerate(self.shapes) if number != own]
        return np.asarray(shape - np.mean(others, axis=0))


@dataclass(frozen=True)
class Case:
    """A mould, its parameters, and the setting of a comparison."""

    name: str
    mould: Mould
    parameters: CellParameters
    model: NetworkModel
    pixels: int
    seed: int

    @classmethod
    def of(cls, content: dict[str, Any], mould: Mould) -> "Case":
        """The case that a configuration's `comparison` states."""
        given, model = content["case"], content["model"]
        return cls(
            given["name"],
            mould,
            CellParameters(given["delta"], given["kappa_nnn"], given["kappa_nnnn"]),
            NetworkModel(model["layers"], tuple(model["shells"]), model["tension"]),
            content["pixels"],
            content["seed"] % 2**31,
        )

    def simulate(self, accuracy: str, seed: int | None = None) -> Tissue:
        """One run at an accuracy, of the case's seed or another."""
        seed = self.seed if seed is None else seed
        return simulate(self.mould, self.parameters, self.model, accuracy, seed)

    def fields(self, s: Tissue, pixels: int | None = None) -> NDArray[np.float64]:
        """Its fields (8, y, x)."""
        return rasterise(s.positions, s.orientation, s.tension, pixels or self.pixels)

    def shape(self, fields: NDArray[np.floating]) -> NDArray[np.float64]:
        """A/A0 and w/w0 of fields (8, y, x), of any raster."""
        return shape_ratios(fields[0], CastMould(self.mould, self.model.layers, fields.shape[-1]))


@dataclass(frozen=True)
class Comparison:
    """What is compared.

    Parameters
    ----------
    methods : tuple of str
        Accuracies, as `raptor.condor.accuracy_named` takes them.
    layers : tuple of int
        Other numbers of layers, at `standard`, their fields scaled to the case's number.
    shells : tuple
        Other choices of shells, at `standard`.
    pixels : tuple of int
        Other rasters of the `standard` run.
    seeds : int
        Reference runs that measure the spread.
    """

    methods: tuple[str, ...]
    layers: tuple[int, ...] = ()
    shells: tuple[tuple[int, int, int], ...] = ()
    pixels: tuple[int, ...] = ()
    seeds: int = 4

    @property
    def runs(self) -> int:
        """Simulations that one case takes."""
        return self.seeds + len(self.methods) + len(self.layers) + len(self.shells) + bool(self.pixels)


def compare(
    case: Case,
    comparison: Comparison,
    surrogate: "Surrogate | None" = None,
    on_progress: Callable[[str], None] = lambda what: None,
) -> pd.DataFrame:
    """One row a method: cost, energy, and the errors of fields and shapes against reference runs.

    `energy_above_best` is the part by which the energy of bonds, walls and contacts lies above the least
    of any run of the same network without reversed bonds. `core_seconds` are processor time of the
    run, kernels being compiled and loaded before.
    """
    _warm_up(comparison.methods)
    runs = []
    for offset in range(1, comparison.seeds + 1):
        runs.append(_timed(partial(case.simulate, "reference", case.seed + offset)))
        on_progress(f"reference, seed {offset}")
    stacks = [case.fields(s) for s, _ in runs]
    shapes = np.array([case.shape(stack) for stack in stacks])
    reference = Reference(stacks, shapes)
    rows = [
        _row(case, reference, f"reference, seed {own + 1}", stacks[own], seconds, own) | _outcome(s)
        for own, (s, seconds) in enumerate(runs)
    ]
    for method in comparison.methods:
        s, seconds = _timed(partial(case.simulate, method))
        rows.append(_row(case, reference, method, case.fields(s), seconds) | _outcome(s))
        on_progress(method)
    totals = [row["energy"] + row["wall_energy"] for row in rows]
    unfolded = [t for t, row in zip(totals, rows, strict=True) if row["inverted_fraction"] == 0]
    best = min(unfolded, default=np.nan)
    for total, row in zip(totals, rows, strict=True):
        row["energy_above_best"] = total / best - 1 if best else np.nan
    rows += _other_models(case, reference, comparison, on_progress)
    rows += _other_rasters(case, reference, comparison.pixels, on_progress)
    if surrogate is not None:
        predicted, seconds = _timed(partial(surrogate.predict, case.mould, [case.parameters]))
        shape = surrogate.ratios(predicted[0, 0], surrogate.cast(case.mould))
        row = _row(case, reference, "surrogate", predicted[0], seconds)
        row["area_error"], row["width_error"] = reference.shape_error(shape)
        rows.append(row)
    spread = {"density_spread": reference.spread[0], "area_spread": shapes[:, 0].std(ddof=1)}
    spread["width_spread"] = shapes[:, 1].std(ddof=1)
    table = pd.DataFrame(rows).assign(**spread)
    return table.fillna({"cells": runs[0][0].cells})


def _warm_up(methods: tuple[str, ...]) -> None:
    """Load the kernels of every precision."""
    gel = Mould(shapely.box(-2, -2, 2, 2), name="gel")
    for name in {"standard", *("standard-float32" for method in methods if method.endswith("-float32"))}:
        simulate(gel, CellParameters(0.5, 0.5, 0.3), NetworkModel(2), name)


def _other_models(
    case: Case, reference: Reference, comparison: Comparison, on_progress: Callable[[str], None]
) -> list[dict[str, Any]]:
    """The `standard` run with other layers or shells, its fields scaled to the case's layers."""
    models = {f"{n} layers": replace(case.model, layers=n) for n in comparison.layers}
    for shells in comparison.shells:
        name = "shells " + " ".join(str(shell) for shell in shells)
        models[name] = replace(case.model, shells=shells)
    rows = []
    for name, model in models.items():
        other = replace(case, model=model)
        s, seconds = _timed(partial(other.simulate, "standard"))
        fields = case.fields(s) * case.model.layers / model.layers
        rows.append(_row(case, reference, name, fields, seconds) | _outcome(s))
        on_progress(name)
    return rows


def _other_rasters(
    case: Case, reference: Reference, rasters: tuple[int, ...], on_progress: Callable[[str], None]
) -> list[dict[str, Any]]:
    """The `standard` run on other rasters, spread evenly over the case's pixels."""
    if not rasters:
        return []
    s, simulating = _timed(partial(case.simulate, "standard"))
    on_progress("rasters")
    rows = []
    for pixels in rasters:
        fields, seconds = _timed(partial(case.fields, s, pixels))
        row = _row(case, reference, f"{pixels} pixels", _resampled(fields, case.pixels), seconds)
        row["area_error"], row["width_error"] = reference.shape_error(case.shape(fields))
        rows.append(row | {"core_seconds": simulating + seconds, "raster_seconds": seconds})
    return rows


def _resampled(fields: NDArray[np.float64], pixels: int) -> NDArray[np.float64]:
    """Fields (8, y, x) on another raster; sums over the image stay."""
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
    case: Case,
    reference: Reference,
    method: str,
    fields: NDArray[np.floating],
    seconds: float,
    own: int | None = None,
) -> dict[str, Any]:
    errors = reference.field_error(fields, own)
    area_error, width_error = reference.shape_error(case.shape(fields), own)
    return {
        "case": case.name,
        "method": method,
        "core_seconds": seconds,
        "density_error": float(errors[0]),
        "tension_error": float(errors[1]),
        "sxsx_error": float(errors[2]),
        "area_error": float(area_error),
        "width_error": float(width_error),
    }


def _distance(a: NDArray[np.floating], b: NDArray[np.floating]) -> NDArray[np.float64]:
    """Root mean square over pixels of the difference of two stacks, a field (8,)."""
    return np.asarray(np.sqrt(((a - b) ** 2).mean(axis=(1, 2))))


def summarise(table: pd.DataFrame) -> pd.DataFrame:
    """One row a method, over its cases: geometric mean of costs, medians and extremes of errors."""
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
        "folded_fraction_max": groups["inverted_fraction"].max(),
    }
    return pd.DataFrame(spreads).reset_index()
