"""Out-of-distribution moulds, unlike the random ones of the training set, for testing surrogates.

Each is as large as random moulds may be and has two mirror axes.
"""

import numpy as np
import shapely
import shapely.affinity
from numpy.random import Generator

from raptor.frame import IMAGE_SIZE
from raptor.moulds.geometry import SMALLEST_TETHER, Circle, Mould, PolygonTether
from raptor.moulds.random_moulds import MARGIN, TETHER_RADIUS, RandomMoulds


def long_bars(like: RandomMoulds, rng: Generator, layers: int, name: str) -> Mould:
    """An I-shape held by a bar along most of each end, much longer than random tethers are wide."""
    end, waist, bar = 15.0, rng.uniform(6.0, 11.0), rng.uniform(14.0, 26.0)
    right = [(14.0, -waist), (17.0, -end), (26.0, -end), (26.0, end), (17.0, end), (14.0, waist)]
    outline = shapely.Polygon(right + [(-x, -y) for x, y in right])
    scale = _scale(like, rng, outline, layers)
    half = max(0.9, 1.1 * SMALLEST_TETHER / scale)
    bars = [shapely.box(side * 21.5 - half, -bar / 2, side * 21.5 + half, bar / 2) for side in (-1, 1)]
    return Mould(outline, tuple(PolygonTether(bar) for bar in bars), "mirrors", name).scaled(scale)


def slender_strips(like: RandomMoulds, rng: Generator, layers: int, name: str) -> Mould:
    """A strip of an aspect from 3.5 to 5, half as much again as random moulds, with a post at each end."""
    aspect, radius = rng.uniform(3.5, 5.0), rng.uniform(*TETHER_RADIUS)
    strip = shapely.box(-aspect / 2, -0.5, aspect / 2, 0.5)
    scale = _scale(like, rng, strip, layers)
    x = aspect * scale / 2 - radius - 0.25 * scale
    posts = (Circle(-x, 0.0, radius), Circle(x, 0.0, radius))
    return Mould(shapely.affinity.scale(strip, scale, scale, origin=(0, 0)), posts, "mirrors", name)


def _scale(like: RandomMoulds, rng: Generator, outline: shapely.Polygon, layers: int) -> float:
    """The factor that scales an outline to an area of random moulds, within the image."""
    area = rng.uniform(*like.cells) / layers
    largest = (IMAGE_SIZE / 2 - MARGIN) / max(map(abs, outline.bounds))
    return float(min(np.sqrt(area / outline.area), largest))
