"""Simulations beside the design: the noise floor, what is unlike all that was drawn, and more to learn from.

Each set has a design and moulds of its own, in the form of the data set's.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import shapely
import shapely.affinity

from raptor.core.errors import RaptorError
from raptor.dataset.design import DesignRules, Run, draw_parameters, sample_design
from raptor.frame import IMAGE_SIZE
from raptor.moulds.geometry import SMALLEST_TETHER, Circle, Mould, PolygonTether
from raptor.moulds.random_moulds import RandomMoulds
from raptor.parameters import Bounds, CellParameters

STREAMS = {"floor": 11, "bars": 12, "slender": 13, "corner": 14, "random": 15, "enriched": 16}
"""Of each set's random numbers, beside those of the design (0 to 2)."""
CORNER = DesignRules(1, 0, 0, 0, Bounds(0.85, 0.95), Bounds(0.10, 0.20), Bounds(0.01, 0.05))
"""High delta, low kappas: where the paper's network fails."""


def further_set(
    name: str,
    size: int,
    runs: Sequence[Run],
    moulds: dict[str, Mould],
    rules: DesignRules,
    drawn: RandomMoulds,
    seed: int,
    seeds: int = 1,
) -> tuple[list[Run], list[Mould]]:
    """The runs of a further set, and their moulds.

    Parameters
    ----------
    name : str
        floor: test runs again with other seeds; bars: I-shapes held by long bars; slender: strips with posts
        at their ends; corner: moulds drawn as the design's, in the soft corner of the parameters. All of them
        are held out. random and enriched: drawn as the design, for training.
    runs, moulds
        Of the design, for the floor.
    rules, drawn
        What the design is drawn from.
    seeds : int
        Further seeds of each run of the floor.

    Raises
    ------
    RaptorError
        Where there is no such set.
    """
    if name not in STREAMS:
        raise RaptorError(f"there is no further set '{name}'; known are {', '.join(STREAMS)}")
    stream = [seed, STREAMS[name]]
    if name == "floor":
        return _floor(size, runs, moulds, stream, seeds)
    if name not in ("bars", "slender"):
        own = replace(CORNER if name == "corner" else rules, simulations=size, test=0, validation=0, edge=0)
        drawn_runs, made = sample_design(own, drawn, int(np.random.default_rng(stream).integers(2**62)))
        split = "test" if name == "corner" else "train"
        return [replace(run, split=split) for run in drawn_runs], made
    draw_mould = _barred if name == "bars" else _slender
    made, chosen = [], []
    for number in range(size):
        rng = np.random.default_rng([*stream, number])
        made.append(replace(draw_mould(rng, drawn), name=f"{name}{number:04d}"))
        chosen.append(_run(number, made[-1].name, draw_parameters(rules, rng), rng))
    return chosen, made


def _floor(
    size: int, runs: Sequence[Run], moulds: dict[str, Mould], stream: list[int], seeds: int
) -> tuple[list[Run], list[Mould]]:
    """Test runs, chosen at random, each again with further seeds."""
    test = [run for run in runs if run.split == "test"]
    order = np.random.default_rng(stream).permutation(len(test))[: size // seeds]
    chosen = [test[number] for number in sorted(order)]
    again = [
        _run(number, run.mould, run.parameters, np.random.default_rng([*stream, run.simulation, seed]))
        for number, (run, seed) in enumerate(product(chosen, range(seeds)))
    ]
    return again, [moulds[run.mould] for run in chosen]


def _run(number: int, mould: str, parameters: CellParameters, rng: np.random.Generator) -> Run:
    return Run(number, mould, "test", False, parameters, int(rng.integers(2**53)))


def _barred(rng: np.random.Generator, drawn: RandomMoulds) -> Mould:
    """An I-shape held by a bar along most of each end, as long as few tethers drawn at random are."""
    end, waist, bar = 15.0, rng.uniform(6.0, 11.0), rng.uniform(14.0, 26.0)
    right = [(14.0, -waist), (17.0, -end), (26.0, -end), (26.0, end), (17.0, end), (14.0, waist)]
    outline = shapely.Polygon(right + [(-x, -y) for x, y in right])
    scale = _scale(rng, drawn, outline)
    half = max(0.9, 1.1 * SMALLEST_TETHER / scale)
    bars = [shapely.box(side * 21.5 - half, -bar / 2, side * 21.5 + half, bar / 2) for side in (-1, 1)]
    tethers = tuple(PolygonTether(shapely.affinity.scale(b, scale, scale, origin=(0, 0))) for b in bars)
    return Mould(shapely.affinity.scale(outline, scale, scale, origin=(0, 0)), tethers, "mirrors")


def _slender(rng: np.random.Generator, drawn: RandomMoulds) -> Mould:
    """A strip of an aspect from 3.5 to 5, half as much again as moulds drawn, with a post at each end."""
    aspect, radius = rng.uniform(3.5, 5.0), rng.uniform(*drawn.tether_radius)
    unit = shapely.box(-aspect / 2, -0.5, aspect / 2, 0.5)
    scale = _scale(rng, drawn, unit)
    x = aspect * scale / 2 - radius - 0.25 * scale
    posts = (Circle(-x, 0.0, radius), Circle(x, 0.0, radius))
    return Mould(shapely.affinity.scale(unit, scale, scale, origin=(0, 0)), posts, "mirrors")


def _scale(rng: np.random.Generator, drawn: RandomMoulds, outline: shapely.Polygon) -> float:
    """The factor by which an outline has an area that moulds drawn at random may have, in the image."""
    area = rng.uniform(*drawn.cells) / drawn.layers
    reach = max(map(abs, outline.bounds))
    largest = (IMAGE_SIZE / 2 - drawn.margin) / reach
    return float(min(np.sqrt(area / outline.area), largest))
