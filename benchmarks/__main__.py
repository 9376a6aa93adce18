"""Print the benchmark: python -m benchmarks [--quick]."""

from collections.abc import Iterable
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from benchmarks.kernels import Rate, bounds, gradient_rates, trial_rates
from benchmarks.solvers import Minimised, against_scipy, posted_rectangle, time_against_cells
from raptor.condor.simulate import simulate
from raptor.condor.system import build_system
from raptor.moulds import Mould, read_mould
from raptor.parameters import CellParameters, NetworkModel

MIDDLE = CellParameters(0.5, 0.5, 0.3)
SOFT = CellParameters(0.9, 0.1, 0.01)
SEEDS = 8
CONSOLE = Console(width=110)


def main(
    quick: Annotated[bool, typer.Option(help="a small mould, to see that everything runs")] = False,
) -> None:
    """Kernels and solvers against baselines in the same run, on one core."""
    mould, model = read_mould("reference_rectangle"), NetworkModel(6)
    if quick:
        mould, model = read_mould("small_rectangle"), NetworkModel(2)
    system = build_system(mould, MIDDLE, model)
    CONSOLE.print(
        f"{mould.name}: {system.lattice.cells} cells, {system.lattice.bonds} bonds, {model.layers} layers"
    )
    _print_rates("Gradient, million directed bonds a second", gradient_rates(mould, MIDDLE, model))
    for precision in (np.float64, np.float32):
        system = build_system(mould, MIDDLE, model, precision)
        name = np.dtype(precision).name
        limits = [(b.what, b.machine, f"{b.rate / 1e6:.0f}") for b in bounds(system, precision)]
        _print(f"The machine's bounds on it, {name}", ("what", "measured", "million a second"), limits)
    _print_rates("Trial moves, million a second", trial_rates(mould, MIDDLE, model))
    _print_minimisers(list(against_scipy(mould, MIDDLE, model, 50 if quick else 500)))
    _print_levels(mould, model, 2 if quick else SEEDS)
    _print_scaling((300, 600) if quick else (1000, 3000, 10000, 30000, 100000), 1 if quick else 3)


def _print_minimisers(minimised: list[Minimised]) -> None:
    base = minimised[0].seconds / minimised[0].evaluations
    rows = [
        (
            m.name,
            f"{m.energy:.3f}",
            str(m.evaluations),
            f"{m.seconds:.2f}",
            f"{m.seconds / m.evaluations / base:.1f} x",
        )
        for m in minimised
    ]
    heads = ("minimiser", "energy", "evaluations", "s", "time an evaluation")
    _print("A step of a contraction", heads, rows)


def _print_rates(title: str, rates: Iterable[Rate]) -> None:
    found = list(rates)
    first = found[0].rate
    rows = ((r.name, f"{r.rate / 1e6:.2f}", f"{r.rate / first:.1f} x") for r in found)
    _print(title, ("what", "million a second", "against the first"), rows)


def _print_levels(mould: Mould, model: NetworkModel, seeds: int) -> None:
    rows = []
    for name, parameters in (("middle", MIDDLE), ("soft", SOFT)):
        for accuracy in ("standard", "standard-float32"):
            tissues = [simulate(mould, parameters, model, accuracy, seed) for seed in range(seeds)]
            energies = [t.energy for t in tissues]
            rows.append(
                (
                    name,
                    accuracy,
                    f"{np.median(energies):.2f}",
                    f"{min(energies):.2f} to {max(energies):.2f}",
                    f"{max(t.inverted_fraction for t in tissues):.0e}",
                    f"{np.median([t.wall_time for t in tissues]):.2f}",
                    f"{sum(t.converged for t in tissues)} of {seeds}",
                )
            )
    heads = ("case", "accuracy", "median E", "E", "inverted, most", "median s", "converged")
    _print(f"Whole runs, {seeds} seeds", heads, rows)


def _print_scaling(sizes: tuple[int, ...], seeds: int) -> None:
    simulate(posted_rectangle(300)[0], MIDDLE, NetworkModel(2))  # compiled before it is timed
    found = list(time_against_cells(sizes, MIDDLE, seeds))
    rows = [
        (
            str(s.cells),
            f"{s.seconds:.2f}",
            str(s.evaluations),
            f"{s.seconds / s.evaluations / s.cells * 1e9:.0f}",
        )
        for s in found
    ]
    _print(
        "Time of standard against cells, middle case",
        ("cells", "s", "evaluations", "ns a cell and evaluation"),
        rows,
    )
    cells, times = np.log([s.cells for s in found]), np.log([s.seconds for s in found])
    CONSOLE.print(f"time grows as cells to the power {np.polyfit(cells, times, 1)[0]:.2f}")


def _print(title: str, heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> None:
    table = Table(title=title, title_justify="left")
    for number, head in enumerate(heads):
        table.add_column(head, justify="right" if number else "left")
    for row in rows:
        table.add_row(*row)
    CONSOLE.print(table)


if __name__ == "__main__":
    typer.run(main)
