"""Where tissue comes off a tether, and what decides it: python -m benchmarks.lost_tethers.

Finds the designs of config/paper.yaml whose tissue loses a tether, simulates them again with other seeds and
other settings of the solver, and follows one of them through its contraction. With a temporary
NUMBA_CACHE_DIR, --max-step tries another limit of a minimiser's step, which is compiled in.
"""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pandas as pd
import shapely
import typer
from matplotlib.axes import Axes
from numpy.typing import NDArray

from benchmarks.measures import paper_designs
from raptor.condor import minimise
from raptor.condor.accuracy import ACCURACIES
from raptor.condor.contract import Contraction, contract, steps_to
from raptor.condor.minimise import Minimum
from raptor.condor.system import System, build_system, cast_state
from raptor.condor.walls import STIFFNESS, build_walls
from raptor.fields.tethers import held, posts_lost
from raptor.moulds import Mould, read_mould
from raptor.moulds.cast import CastMould
from raptor.parameters import CellParameters, NetworkModel
from raptor.plotting.drawing import new_figure

STANDARD = ACCURACIES["standard"].contraction


class Setting(NamedTuple):
    """A way to solve: stiffness of the walls (kappa0) and how the contraction is followed."""

    stiffness: float
    contraction: Contraction


SETTINGS = {
    "standard": Setting(STIFFNESS, STANDARD),
    "walls of stiffness 50": Setting(50.0, STANDARD),
    "walls of stiffness 400": Setting(400.0, STANDARD),
    "small steps of Delta": Setting(STIFFNESS, replace(STANDARD, shortening=0.05)),
    "each step minimised": Setting(
        STIFFNESS, replace(STANDARD, ftol=STANDARD.last_ftol, step_evaluations=10000)
    ),
    "no agitation": Setting(STIFFNESS, replace(STANDARD, sweeps=0)),
    "fivefold agitation": Setting(STIFFNESS, replace(STANDARD, sweeps=5 * STANDARD.sweeps)),
}


def solve(
    mould: Mould, cells: CellParameters, layers: int, setting: Setting, seed: int
) -> tuple[Minimum, NDArray[np.float64]]:
    """The minimum, and positions (cells, 3)."""
    system = prepared(mould, cells, layers, setting)
    rng = np.random.default_rng(seed)
    minimum = contract(cast_state(system.lattice.sites, rng), system, cells.delta, setting.contraction, rng)
    return minimum, positions_of(minimum, system)


def prepared(mould: Mould, cells: CellParameters, layers: int, setting: Setting) -> System:
    """The system with walls of the setting's stiffness."""
    model = NetworkModel(layers)
    system = build_system(mould, cells, model)
    return replace(system, walls=build_walls(mould, model.height, setting.stiffness))


def positions_of(minimum: Minimum, system: System) -> NDArray[np.float64]:
    """Positions (cells, 3), l0."""
    return np.asarray(minimum.state[: 3 * system.lattice.cells].reshape(3, -1).T, dtype=np.float64)


def vary(
    cases: dict[str, tuple[Mould, CellParameters]], layers: int, seeds: int, settings: dict[str, Setting]
) -> pd.DataFrame:
    """One row a case, setting and seed: tethers lost, energy of bonds and walls, deepest cell in a wall."""
    rows = []
    for name, (mould, cells) in cases.items():
        cast = CastMould(mould, layers, 256)
        for what, setting in settings.items():
            for seed in range(seeds):
                minimum, positions = solve(mould, cells, layers, setting, seed)
                shares = held(positions, cast)
                rows.append(
                    {
                        "case": name, "setting": what, "seed": seed, "lost": posts_lost(shares),
                        "which": " ".join(str(n) for n in np.flatnonzero(shares < 0.5)),
                        "energy": minimum.energy + minimum.wall_energy,
                        "deepest": float(mould.forbidden_depth(positions[:, :2]).max()),
                    }
                )  # fmt: skip
            typer.echo(f"{name}, {what}: {[row['lost'] for row in rows[-seeds:]]}")
    return pd.DataFrame(rows)


def follow(
    mould: Mould, cells: CellParameters, layers: int, seed: int, steps: int
) -> tuple[pd.DataFrame, NDArray[np.float64]]:
    """Of each tether at each step of Delta: share held, bonds of its loops over it, longest; positions."""
    setting = SETTINGS["standard"]
    cast, system = CastMould(mould, layers, 256), prepared(mould, cells, layers, setting)
    rng = np.random.default_rng(seed)
    state = cast_state(system.lattice.sites, rng)
    rows: list[dict[str, Any]] = []
    positions = system.lattice.sites
    for delta in steps_to(cells.delta, 1 - (1 - cells.delta) ** (1 / steps)):
        one = replace(setting.contraction, shortening=1.0)  # one step, from where the last ended
        minimum = contract(state, system, float(delta), one, rng)
        state, positions = minimum.state, positions_of(minimum, system)
        for number, (share, loops) in enumerate(zip(held(positions, cast), cast.loops, strict=True)):
            lines = [_segments(positions[loop, :2]) for loop in loops]
            core = mould.tethers[number].polygon.buffer(-0.3)
            over = np.concatenate([shapely.intersects(each, core) for each in lines])
            lengths = np.concatenate([shapely.length(each) for each in lines])
            rows.append(
                {
                    "delta": delta, "tether": number, "held": share, "bonds_over": int(over.sum()),
                    "longest": lengths.max(),
                    "deepest": float(mould.forbidden_depth(positions[:, :2]).max()),
                }
            )  # fmt: skip
    return pd.DataFrame(rows), positions


def _segments(loop: NDArray[np.float64]) -> Any:
    return shapely.linestrings(np.stack([loop, np.roll(loop, -1, axis=0)], axis=1))


def draw(axes: Axes, mould: Mould, layers: int, positions: NDArray[np.float64], tether: int) -> None:
    """Cells of the lowest layer around a tether, and the path that went around it as cast."""
    cast = CastMould(mould, layers, 256)
    lowest = cast.sites[:, 2] == cast.sites[0, 2]
    axes.plot(*positions[lowest, :2].T, "o", ms=3, color="#888888")
    loop = cast.loops[tether][0]
    axes.plot(*positions[[*loop, loop[0]], :2].T, "o-", ms=4, color="#1f77b4")
    for other in mould.tethers:
        axes.fill(*np.array(other.polygon.exterior.coords).T, color="#d62728", alpha=0.5)
    axes.plot(*np.array(mould.outline.exterior.coords).T, color="#444444", lw=1)
    centre = mould.tethers[tether].polygon.centroid
    axes.set(
        xlim=(centre.x - 8, centre.x + 8),
        ylim=(centre.y - 8, centre.y + 8),
        aspect="equal",
        xlabel="x ($l_0$)",
    )


def figure(path: Path, mould: Mould, cells: CellParameters, layers: int, seeds: int) -> None:
    """Draw a tether that one seed keeps and another loses, and how it comes off as Delta rises."""
    runs = [follow(mould, cells, layers, seed, 12) for seed in range(seeds)]
    last = np.array([table[table["delta"] == cells.delta]["held"].to_numpy() for table, _ in runs])
    mixed = np.flatnonzero((last < 0.5).any(axis=0) & (last >= 0.5).any(axis=0))
    tether = int(mixed[0]) if len(mixed) else int(np.argmin(last.min(axis=0)))
    keeps, loses = int(np.argmax(last[:, tether])), int(np.argmin(last[:, tether]))
    drawn = new_figure(12, 4)
    kept, lost, course = drawn.subplots(1, 3)
    draw(kept, mould, layers, runs[keeps][1], tether)
    draw(lost, mould, layers, runs[loses][1], tether)
    kept.set(title="one seed: held", ylabel="y ($l_0$)")
    lost.set(title="another seed: lost")
    table = runs[loses][0]
    table = table[table["tether"] == tether]
    course.plot(table["delta"], table["bonds_over"], "o-", label="bonds of the path over the tether")
    course.plot(table["delta"], table["longest"], "s-", label="longest bond of the path ($l_0$)")
    course.plot(table["delta"], table["held"] * 10, "^-", label="held (x 10)")
    course.set(xlabel="$\\Delta$", title="the second seed as $\\Delta$ rises")
    course.legend(fontsize=8)
    drawn.savefig(path, dpi=110, bbox_inches="tight")


def main(
    designs: Annotated[int, typer.Option(help="of config/paper.yaml that are looked through")] = 120,
    layers: Annotated[int, typer.Option(help="of cells")] = 4,
    seeds: Annotated[int, typer.Option(help="of each setting")] = 4,
    max_step: Annotated[float | None, typer.Option(help="limit of a minimiser's step, l0")] = None,
    output: Annotated[Path | None, typer.Option(help="CSV of every run")] = None,
    picture: Annotated[Path | None, typer.Option(help="PNG of a tether that comes off")] = None,
) -> None:
    """Print how many tethers are lost, by case and setting."""
    if max_step is not None:
        minimise.MAX_STEP = max_step  # before anything is compiled
    found: dict[str, tuple[Mould, CellParameters]] = {}
    for run, mould in paper_designs(designs):
        _, positions = solve(mould, run.parameters, layers, SETTINGS["standard"], run.seed)
        shares = held(positions, CastMould(mould, layers, 256))
        if posts_lost(shares):
            p = run.parameters
            typer.echo(f"{mould.name}: {posts_lost(shares)} of {len(shares)} lost, Delta {p.delta:.2f}")
            found[mould.name] = mould, run.parameters
    typer.echo(f"{len(found)} of {designs} designs lose a tether ({layers} layers)")
    for name in ("i_shape", "fibroblast"):
        found[name] = read_mould(name), CellParameters(0.93, 0.3, 0.1)
    settings = SETTINGS if max_step is None else {f"steps of {max_step} l0": SETTINGS["standard"]}
    table = vary(found, layers, seeds, settings)
    wide = table.groupby(["case", "setting"], sort=False)["lost"].agg(lambda x: " ".join(map(str, x)))
    typer.echo(wide.unstack("setting", sort=False).to_string())
    summary = table.groupby("setting", sort=False).agg(lost=("lost", "mean"), deepest=("deepest", "max"))
    typer.echo(summary.to_string())
    if output is not None:
        table.to_csv(output, index=False)
    if picture is not None:
        uncertain = table.groupby("case")["lost"].agg(np.ptp).idxmax()
        figure(picture, *found[str(uncertain)], layers, seeds)


if __name__ == "__main__":
    typer.run(main)
