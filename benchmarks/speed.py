"""`standard` of two checkouts side by side: python -m benchmarks.speed BEFORE [--seeds 8] [--cases bars].

BEFORE is a commit, which is unpacked into a temporary folder, or a folder that holds another checkout.
Both run in the same minutes, case by case and seed by seed in turn, each in a process of its own on one core.
Errors are those of the trade-off, in seed-to-seed spreads of the `reference` runs of the same checkout.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import shapely
import typer
import yaml
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.solvers import posted_rectangle
from raptor.fields.shape import shape_ratios
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Circle, Mould
from raptor.moulds.reading import read_mould
from raptor.raster import rasterise
from raptor.studies.tradeoff import Reference

ROOT = Path(__file__).parents[1]
PIXELS = 256
CONSOLE = Console(width=120)
WORKER = """
import json, sys, time
import numpy as np
import shapely
from raptor.moulds.geometry import Circle, Mould, PolygonTether
from raptor.parameters import CellParameters, NetworkModel
try:
    from raptor.condor.simulate import simulate
except ImportError:
    from raptor.condor import simulate
for line in sys.stdin:
    job = json.loads(line)
    bars = [PolygonTether(shapely.from_wkt(wkt)) for wkt in job["bars"]]
    tethers = (*(Circle(*post) for post in job["posts"]), *bars)
    mould = Mould(shapely.from_wkt(job["outline"]), tethers, name=job["name"])
    began = time.process_time()
    cells, layers = CellParameters(*job["cell"]), NetworkModel(job["layers"])
    t = simulate(mould, cells, layers, job["accuracy"], job["seed"])
    seconds = time.process_time() - began
    np.savez(job["output"], positions=t.positions, orientation=t.orientation, tension=t.tension)
    inverted = t.inverted_fraction if hasattr(t, "inverted_fraction") else t.folded_fraction
    told = {"seconds": seconds, "evaluations": t.gradient_evaluations, "cells": len(t.positions),
            "converged": bool(t.converged), "inverted": float(inverted)}
    print(json.dumps(told), flush=True)
"""


@dataclass(frozen=True)
class Case:
    """A mould, layers and cells' parameters."""

    name: str
    mould: Mould
    layers: int
    cell: tuple[float, float, float]

    def job(self) -> dict[str, Any]:
        """As a worker reads it: in nothing that has changed from version to version."""
        tethers = self.mould.tethers
        return {
            "name": self.name,
            "outline": shapely.to_wkt(self.mould.outline, rounding_precision=-1),
            "posts": [[t.x, t.y, t.radius] for t in tethers if isinstance(t, Circle)],
            "bars": [
                shapely.to_wkt(t.polygon, rounding_precision=-1) for t in tethers if not isinstance(t, Circle)
            ],
            "layers": self.layers,
            "cell": self.cell,
        }


class Checkout:
    """A process that simulates with a checkout's code, and keeps its reference runs in a folder."""

    def __init__(self, source: Path, folder: Path) -> None:
        environment = os.environ | {"PYTHONPATH": str(source / "src"), "OMP_NUM_THREADS": "1"}
        command = [sys.executable, "-c", WORKER]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def run(self, case: Case, accuracy: str, seed: int) -> tuple[dict[str, Any], NDArray[np.float64]]:
        """What the run cost, and its fields (8, y, x); a reference run of before is read again."""
        output = self.folder / f"{case.name}-{accuracy}-{seed}.npz"
        told = output.with_suffix(".json")
        if accuracy != "reference" or not told.exists():
            assert self.process.stdin is not None
            assert self.process.stdout is not None
            job = case.job() | {"accuracy": accuracy, "seed": seed, "output": str(output)}
            self.process.stdin.write(json.dumps(job) + "\n")
            self.process.stdin.flush()
            told.write_text(self.process.stdout.readline())
        with np.load(output) as found:
            fields = rasterise(found["positions"], found["orientation"], found["tension"], PIXELS)
        return json.loads(told.read_text()), fields

    def close(self) -> None:
        """End the process."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()


def tradeoff_cases() -> list[Case]:
    """The cases of config/tradeoff.yaml."""
    content = yaml.safe_load((ROOT / "config/tradeoff.yaml").read_text())
    return [
        Case(
            name,
            read_mould(case["mould"]),
            case.get("layers", content["layers"]),
            (case["delta"], case["kappa_nnn"], case["kappa_nnnn"]),
        )
        for name, case in content["tradeoff"]["cases"].items()
    ]


@contextmanager
def checkouts(before: str, folder: Path) -> Iterator[dict[str, Checkout]]:
    """The other checkout and this one, ready to run."""
    with ExitStack() as stack:
        source = Path(before)
        if not source.is_dir():
            source = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            packed = subprocess.run(["git", "archive", before], cwd=ROOT, check=True, capture_output=True)
            subprocess.run(["tar", "-x", "-C", str(source)], input=packed.stdout, check=True)
        both = {"before": Checkout(source, folder / "before"), "now": Checkout(ROOT, folder / "now")}
        for checkout in both.values():
            stack.callback(checkout.close)
        yield both


def measured(case: Case, both: dict[str, Checkout], seeds: int) -> dict[str, NDArray[np.float64]]:
    """Rows (seeds, 7) of each checkout: seconds, evaluations, errors in spreads, share of inverted bonds.

    Errors are of density, SxSx, A/A0 and w/w0.
    """
    cast = CastMould(case.mould, case.layers, PIXELS)
    references = {}
    for name, checkout in both.items():
        stacks = [checkout.run(case, "reference", seed)[1] for seed in range(101, 105)]
        references[name] = Reference(stacks, np.array([shape_ratios(stack[0], cast) for stack in stacks]))
    rows: dict[str, list[list[float]]] = {name: [] for name in both}
    for seed, (name, checkout) in product(range(1, seeds + 1), both.items()):
        told, fields = checkout.run(case, "standard", seed)
        reference = references[name]
        errors = reference.field_error(fields)
        shape = reference.shape_error(shape_ratios(fields[0], cast)) / reference.shapes.std(axis=0, ddof=1)
        rows[name].append(
            [told["seconds"], told["evaluations"], errors[0], errors[2], *np.abs(shape), told["inverted"]]
        )
    return {name: np.array(found) for name, found in rows.items()}


def scaling(both: dict[str, Checkout], sizes: tuple[int, ...]) -> dict[str, NDArray[np.float64]]:
    """Rows (sizes, 3) of each checkout: cells, seconds and evaluations of one middle case."""
    rows: dict[str, list[list[float]]] = {name: [] for name in both}
    for size in sizes:
        mould, layers = posted_rectangle(size)
        case = Case(f"rectangle_{size}", mould, layers, (0.5, 0.5, 0.3))
        for name, checkout in both.items():
            told, _ = checkout.run(case, "standard", 1)
            rows[name].append([told["cells"], told["seconds"], told["evaluations"]])
    return {name: np.array(found) for name, found in rows.items()}


def main(
    before: Annotated[str, typer.Argument(help="commit, or folder of another checkout")],
    seeds: Annotated[int, typer.Option(min=1, help="runs a case and checkout")] = 8,
    cases: Annotated[str, typer.Option(help="names of cases, with commas; all of the trade-off's")] = "",
    sizes: Annotated[str, typer.Option(help="cells of growing moulds, with commas")] = "1000,3000,10000",
    folder: Annotated[Path | None, typer.Option(help="where reference runs are kept")] = None,
) -> None:
    """Compare this checkout's `standard` with another's."""
    with ExitStack() as stack:
        kept = folder or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        both = stack.enter_context(checkouts(before, kept))
        chosen = [case for case in tradeoff_cases() if not cases or case.name in cases.split(",")]
        for checkout in both.values():  # kernels are compiled before anything is timed
            checkout.run(chosen[0], "standard", 0)
        table = Table(
            *("case", "time, s", "ratio", "evaluations", "density", "SxSx", "A/A0", "w/w0", "inverted")
        )
        ratios, errors = [], []
        for case in chosen:
            found = measured(case, both, seeds)
            old, new = (np.median(found[name], axis=0) for name in ("before", "now"))
            ratios.append(new[:2] / old[:2])
            errors.append([old[2:6], new[2:6]])
            pairs = [f"{a:.2f}, {b:.2f}" for a, b in zip(old[2:6], new[2:6], strict=True)]
            worst = [f"{found[name][:, 6].max():.0e}" for name in ("before", "now")]
            costs = [f"{old[0]:.2f}, {new[0]:.2f}", f"{new[0] / old[0]:.2f}", f"{old[1]:.0f}, {new[1]:.0f}"]
            table.add_row(case.name, *costs, *pairs, ", ".join(worst))
            CONSOLE.print(f"{case.name}: {new[0] / old[0]:.2f} of the time", highlight=False)
        CONSOLE.print(table)
        time, evaluations = np.exp(np.log(ratios).mean(axis=0))
        CONSOLE.print(f"of the time {time:.2f}, of the evaluations {evaluations:.2f} (geometric means)")
        for number, name in enumerate(("before", "now")):
            of = np.array(errors)[:, number]
            CONSOLE.print(
                f"{name}: median {np.round(np.median(of, axis=0), 2)}, worst {np.round(of.max(axis=0), 2)}"
            )
        for name, rows in scaling(both, tuple(int(size) for size in sizes.split(","))).items():
            power = np.polyfit(np.log(rows[:, 0]), np.log(rows[:, 1]), 1)[0]
            steps = ", ".join(f"{cells:.0f}: {seconds:.2f} s, {count:.0f}" for cells, seconds, count in rows)
            CONSOLE.print(f"{name}: {steps}; time grows as cells to the power {power:.2f}")


if __name__ == "__main__":
    typer.run(main)
