"""What the size of a drawing changes: python -m benchmarks.scale.

The same moulds drawn at 0.7, 0.85 and 1.0 of the frame, tethers and all. CONDOR has no length, but a larger
drawing has more cells in its plane and the same number of layers.
"""

from typing import Annotated

import numpy as np
import shapely
import typer
from numpy.typing import NDArray

from raptor.condor.simulate import simulate
from raptor.frame import IMAGE_SIZE
from raptor.moulds import Circle, Mould, PolygonTether, read_mould
from raptor.moulds.library.tissues import tissue
from raptor.parameters import CellParameters

PARTS = (0.7, 0.85, 1.0)
MEASURES = ("area_ratio", "width_ratio", "alignment")


def moulds() -> list[Mould]:
    """Six moulds as people draw them."""
    cross = shapely.union(shapely.box(-25, -6, 25, 6), shapely.box(-6, -25, 6, 25))
    ends = tuple(Circle(x, y, 1.5) for x, y in ((-21, 0), (21, 0), (0, -21), (0, 21)))
    dog_bone = shapely.union_all(
        [shapely.box(-25, -10, -13, 10), shapely.box(-14, -5, 14, 5), shapely.box(13, -10, 25, 10)]
    )
    corners = tuple(Circle(x, y, 1.5) for x in (-20, 20) for y in (-6, 6))
    ring = shapely.Point(0, 0)
    return [
        read_mould("four_post_rectangle"),
        read_mould("i_shape"),
        read_mould("myoblast"),
        Mould(cross, ends, name="cross"),
        Mould(dog_bone, corners, name="dog_bone"),
        Mould(ring.buffer(24), (PolygonTether(ring.buffer(12)),), name="ring"),
    ]


def drawn_at(mould: Mould, part: float) -> Mould:
    """The mould scaled so that it is as wide as a part of the frame."""
    return mould.scaled(part * 0.999 * IMAGE_SIZE / (2 * np.abs(mould.outline.bounds).max()))


def measured(
    mould: Mould, cells: CellParameters, layers: int, accuracy: str, seeds: int
) -> tuple[NDArray[np.float64], int, int]:
    """Means of `MEASURES` over seeds, most tethers lost, and cells."""
    made = [simulate(mould, cells, layers, accuracy, seed) for seed in range(seeds)]
    means = np.mean([[getattr(each, name) for name in MEASURES] for each in made], axis=0)
    return means, max(each.posts_lost for each in made), made[0].cells


def main(
    layers: Annotated[int, typer.Option(help="of cells")] = 4,
    accuracy: Annotated[str, typer.Option(help="of the simulations")] = "standard",
    seeds: Annotated[int, typer.Option(help="over which ratios are averaged")] = 2,
) -> None:
    """Print a table in Markdown: ratios at 0.7, 0.85 and 1.0 of the frame, and their range."""
    typer.echo("| mould | cells | parameters | A/A0 | range | w/w0 | range | alignment | range |")
    typer.echo("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for mould in moulds():
        for name, cells in (
            ("glial 1", tissue("glial_1").fit),
            ("middle", CellParameters(0.5, 0.5, 0.3)),
        ):
            found = [measured(drawn_at(mould, part), cells, layers, accuracy, seeds) for part in PARTS]
            values = np.array([means for means, _, _ in found])
            columns = [
                f"{', '.join(f'{value:.3f}' for value in column)} | {np.ptp(column):.3f}"
                for column in values.T
            ]
            lost = ", ".join(str(number) for _, number, _ in found)
            note = f" (tethers lost: {lost})" if any(number for _, number, _ in found) else ""
            counts = ", ".join(f"{number:,}" for _, _, number in found)
            typer.echo(f"| {mould.name} | {counts} | {name}{note} | {' | '.join(columns)} |")


if __name__ == "__main__":
    typer.run(main)
