"""How far measures hang on the lattice: python -m benchmarks.measures [--designs 40].

A/A0 and w/w0 over the tissue as cast, and beside them over the mould, as the paper words them.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import shapely
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from raptor.condor.simulate import Tissue, simulate
from raptor.config.reading import load
from raptor.dataset.design import Run
from raptor.fields.shape import mould_ratios, shape_ratios
from raptor.moulds import Circle, Mould, PolygonTether, read_mould
from raptor.moulds.cast import cast_sites
from raptor.moulds.library import MOULDS
from raptor.parameters import CellParameters, NetworkModel
from raptor.raster import density_image

CELLS, MODEL = CellParameters(0.3, 0.5, 0.3), NetworkModel(4)
SIZES = np.linspace(0.96, 1.04, 17)
CONSOLE = Console(width=130)


def main(
    designs: Annotated[int, typer.Option(help="of the paper's, simulated with four seeds each")] = 40,
    output: Annotated[Path | None, typer.Option(help="CSV of the seeds' ratios")] = None,
) -> None:
    """Print the figures, new and as the paper words the measures."""
    scaled = sweep(rectangle().scaled(factor) for factor in SIZES)
    walls = sweep(rectangle(factor) for factor in SIZES)
    crossed = sweep(rectangle(factor, Circle(0, 3, 1.3)) for factor in SIZES)
    middle = len(SIZES) // 2
    rows = [
        ("spread over size, the whole mould scaled by 0.96 to 1.04", *scaled.std(axis=1, ddof=1)),
        ("the same, posts staying where they are", *walls.std(axis=1, ddof=1)),
        ("walls and posts on integers, less the mean over sizes", *(scaled[:, middle] - scaled.mean(axis=1))),
        ("walls on integers, less the mean over sizes of walls", *(walls[:, middle] - walls.mean(axis=1))),
        (
            "with a post of radius 1.3 at (0, 3), less without, mean over sizes",
            *(crossed - walls).mean(axis=1),
        ),
        ("the same, walls and posts on integers", *(crossed - walls)[:, middle]),
    ]
    if designs:
        ratios = seeds(designs)
        deviation = ratios.groupby("simulation").std(ddof=1)[["area", "width", "area_mould", "width_mould"]]
        lost = ratios.groupby("simulation")["lost"].max() > 0
        for name, part in (("all", deviation), ("none lost", deviation[~lost])):
            measured = part.to_numpy().reshape(-1, 2, 2).mean(axis=0)
            rows.append((f"spread over 4 seeds, mean of {len(part)} designs, {name}", *measured))
        if output is not None:
            ratios.to_csv(output, index=False)
    table = Table(title="Tissue of Delta 0.3, four posts in 40 x 20 l0, 4 layers", title_justify="left")
    for head in ("what", "A/A0", "w/w0", "A/A0 over the mould", "w/w0 over the mould"):
        table.add_column(head, justify="left" if head == "what" else "right")
    for what, new, literal in rows:
        table.add_row(what, *(f"{value:+.4f}" for value in (*new, *literal)))
    CONSOLE.print(table)
    moulds = [*map(read_mould, MOULDS), *(mould for _, mould in paper_designs(50))]
    CONSOLE.print(
        f"Delta 0, {len(MOULDS)} moulds of the library and 50 drawn: off 1 by at most {at_rest(moulds):.1e}"
    )
    for what, change in (("rounded to 1e-3 l0", rounded), ("moved by up to 3e-7 l0", shaken)):
        worst = max((changed_cells(mould, change), mould.name) for mould in map(read_mould, MOULDS))
        CONSOLE.print(
            f"cells changed where every coordinate of the library is {what}: {worst[0]:.1%} ({worst[1]})"
        )


def rectangle(factor: float = 1.0, *others: Circle) -> Mould:
    """40 x 20 l0 with posts at (15, 6), times a factor, and others besides."""
    posts = tuple(Circle(x, y, 1.3) for x in (-15, 15) for y in (-6, 6))
    return Mould(shapely.box(-20 * factor, -10 * factor, 20 * factor, 10 * factor), (*posts, *others))


def sweep(moulds: Iterable[Mould]) -> NDArray[np.float64]:
    """Ratios (new and over the mould, moulds, A/A0 and w/w0) of a tissue in each."""
    return np.stack([both(simulate(mould, CELLS, MODEL)) for mould in moulds], axis=1)


def both(made: Tissue) -> NDArray[np.float64]:
    """A/A0 and w/w0, new and over the mould, (2, 2)."""
    density = density_image(made.positions, 256)
    return np.stack([measure(density, made.cast_mould) for measure in (shape_ratios, mould_ratios)])


def seeds(designs: int) -> pd.DataFrame:
    """Ratios of the first designs that config/paper.yaml draws, at `standard`, with four seeds each."""
    configuration = load(Path("config/paper.yaml"))
    rows = []
    for run, mould in paper_designs(designs):
        for further in range(4):
            made = simulate(mould, run.parameters, configuration.network_model, seed=run.seed + further)
            names = ("area", "width", "area_mould", "width_mould")
            row = dict(zip(names, both(made).ravel().tolist(), strict=True))
            rows.append({"simulation": run.simulation, "lost": made.posts_lost, **row})
    return pd.DataFrame(rows)


def at_rest(moulds: Iterable[Mould]) -> float:
    """How far from 1 a ratio is, at most, in tissues simulated at Delta 0."""
    tissues = [simulate(mould, replace(CELLS, delta=0.0), 7, "draft") for mould in moulds]
    ratios = [ratio for made in tissues for ratio in (made.area_ratio, made.width_ratio)]
    return float(np.nanmax(np.abs(np.array(ratios) - 1)))


def paper_designs(count: int) -> list[tuple[Run, Mould]]:
    """The first designs that config/paper.yaml draws, none of them at an end of Delta's range."""
    design = load(Path("config/paper.yaml")).design("paper")
    campaign = design.campaign.model_copy(update={"runs": count, "test": 0, "validation": 0, "edge": 0})
    runs, moulds = design.model_copy(update={"campaign": campaign}).make()
    return list(zip(runs, moulds, strict=True))


def changed_cells(mould: Mould, change: Callable[[Mould], Mould]) -> float:
    """Share of a mould's cells (7 layers) that come or go where its coordinates change a little."""
    before, after = ({tuple(site) for site in cast_sites(m, 2)} for m in (mould, change(mould)))
    return len(before ^ after) / len(before)


def rounded(mould: Mould) -> Mould:
    """A mould with every coordinate rounded to 1e-3 l0."""
    return _moved(mould, lambda values: np.round(values, 3))


def shaken(mould: Mould) -> Mould:
    """A mould with every coordinate off by up to 3e-7 l0."""
    rng = np.random.default_rng(0)
    return _moved(mould, lambda values: values + rng.uniform(-3e-7, 3e-7, np.shape(values)))


def _moved(mould: Mould, change: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> Mould:
    def polygon(shape: shapely.Polygon) -> shapely.Polygon:
        return shapely.Polygon(change(shapely.get_coordinates(shape.exterior)[:-1]))

    tethers = tuple(
        Circle(*change(np.array([t.x, t.y, t.radius])).tolist())
        if isinstance(t, Circle)
        else PolygonTether(polygon(t.polygon))
        for t in mould.tethers
    )
    return replace(mould, outline=polygon(mould.outline), tethers=tethers)


if __name__ == "__main__":
    typer.run(main)
