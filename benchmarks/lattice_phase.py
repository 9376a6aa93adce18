"""How much hangs on where a mould lies on the lattice: python -m benchmarks.lattice_phase CAMPAIGN_FOLDER.

Simulates validation moulds of a campaign three times as drawn and three times moved by parts of l0, each with
a seed of its own, and compares the densities of each pair as an error with its target. Over sqrt 2 that is
the error of a perfect prediction: with pairs at one place, of one that knows the place; with the others, of
one that does not.
"""

from itertools import combinations
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from shapely.affinity import translate

from raptor.condor.simulate import simulate
from raptor.dataset.stack import Sample, read_samples, read_table
from raptor.fields.metrics import vrmse
from raptor.fields.shape import shape_ratios
from raptor.frame import pixel_size
from raptor.moulds import Mould, moulds_by_id
from raptor.moulds.cast import CastMould
from raptor.raster import density_image

PLACES = ((0, 0), (0, 0), (0, 0), (2, 1), (1, 3), (3, 2))
"""Shifts (x, y) in pixels of 0.24 l0, so that images can be moved back exactly."""


def main(
    folder: Annotated[Path, typer.Argument(help="a campaign's folder, with fields.nc and moulds.geojson")],
    count: Annotated[int, typer.Option(help="number of moulds")] = 20,
) -> None:
    """Print mean differences of density, A/A0 and w/w0 between seeds, and between places and seeds."""
    table, moulds = read_table(folder / "fields.nc"), moulds_by_id(folder / "moulds.geojson")
    rows = table.rows("validation")[:count]
    found = []
    for sample in read_samples(folder / "fields.nc", rows):
        densities, ratios = _at_places(moulds[sample.mould], sample, table.layers, table.pixels)
        alike: dict[bool, list[list[float]]] = {True: [], False: []}  # by whether the place is the same
        for a, b in combinations(range(len(PLACES)), 2):
            error = vrmse(densities[a], densities[b]) / np.sqrt(2)
            alike[PLACES[a] == PLACES[b]].append([error, *np.abs(ratios[a] - ratios[b])])
        found.append([np.mean(alike[True], axis=0), np.mean(alike[False], axis=0)])
    for name, (density, area, width) in zip(("seeds", "places"), np.nanmean(found, axis=0), strict=True):
        typer.echo(f"{name}: density {density:.3f}, A/A0 {area:.4f}, w/w0 {width:.4f}, {len(found)} moulds")


def _at_places(
    mould: Mould, sample: Sample, layers: int, pixels: int
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Densities (y, x), moved back, and ratios (2,) at each of `PLACES`, each with a seed of its own."""
    densities, ratios = [], []
    for seed, (x, y) in enumerate(PLACES):
        step = x * pixel_size(pixels), y * pixel_size(pixels)
        moved = Mould(translate(mould.outline, *step), [each.shifted(*step) for each in mould.tethers])
        tissue = simulate(moved, sample.parameters, layers, seed=seed)
        density = density_image(tissue.positions, pixels)
        ratios.append(shape_ratios(density, CastMould(moved, layers, pixels)))
        densities.append(np.roll(density, (-y, -x), (0, 1)))
    return densities, ratios


if __name__ == "__main__":
    typer.run(main)
