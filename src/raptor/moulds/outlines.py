"""Outlines of moulds as people make them, one function per family.

Each draws its proportions from a generator and returns a simple polygon about the origin whose long side
lies along x; its size is set by the caller. Sources of the shapes: rectangles and strips (Garvin 2003,
Kostyuk and Brown 2004, O'Rourke 2015), I-shapes (East 2010), dog bones and pills (Capel 2019), rings and
plates (tissue rings on a central post), and polygons, stars and crosses as people draw them.
"""

from collections.abc import Callable

import numpy as np
import shapely
from numpy.random import Generator
from numpy.typing import NDArray
from shapely.affinity import scale

LONGEST = 5.0  # largest aspect drawn
ARC = 24  # segments a quarter circle of drawn outlines


def _aspect(rng: Generator, largest: float = LONGEST) -> float:
    """Length over width, from 1 on; its logarithm is uniform, so that squares are as common as strips."""
    return float(np.exp(rng.uniform(0.0, np.log(largest))))


def _box(length: float, width: float) -> shapely.Polygon:
    return shapely.box(-length / 2, -width / 2, length / 2, width / 2)


def _mirrored(quarter: NDArray[np.float64]) -> shapely.Polygon:
    """The polygon of corners (n, 2) of the quarter x, y >= 0, counter-clockwise, mirrored in both axes."""
    half = np.concatenate([quarter, (quarter * (-1, 1))[::-1]])
    return shapely.Polygon(np.concatenate([half, (half * (1, -1))[::-1]])).buffer(0)


def rounded(polygon: shapely.Polygon, radius: float, segments: int = ARC) -> shapely.Polygon:
    """The polygon with its outer and inner corners rounded to a radius, in segments a quarter circle."""
    opened = polygon.buffer(-radius, join_style="mitre").buffer(radius, quad_segs=segments)
    return opened.buffer(radius, join_style="mitre").buffer(-radius, quad_segs=segments)


def rectangle(rng: Generator) -> shapely.Polygon:
    """A rectangle of aspect 1 to 5."""
    return _box(_aspect(rng), 1.0)


def rounded_rectangle(rng: Generator) -> shapely.Polygon:
    """A rectangle with corners rounded by 5 to 35 % of its width."""
    return rounded(rectangle(rng), rng.uniform(0.05, 0.35))


def pill(rng: Generator) -> shapely.Polygon:
    """A stadium: a rectangle between two half circles."""
    half = 0.5 * (_aspect(rng) - 1.0)
    return shapely.LineString([(-half, 0), (half, 0)]).buffer(0.5, quad_segs=ARC)


def ellipse(rng: Generator) -> shapely.Polygon:
    """An ellipse of aspect 1 to 4, circles among them."""
    aspect = 1.0 if rng.random() < 0.25 else _aspect(rng, 4.0)
    return scale(shapely.Point(0, 0).buffer(0.5, quad_segs=ARC), aspect, 1.0, origin=(0, 0))


def trapezium(rng: Generator) -> shapely.Polygon:
    """A trapezium whose narrow end is 30 to 85 % of its wide one."""
    half, narrow = 0.5 * _aspect(rng, 4.0), 0.5 * rng.uniform(0.3, 0.85)
    return shapely.Polygon([(-half, -0.5), (half, -narrow), (half, narrow), (-half, 0.5)])


def triangle(rng: Generator) -> shapely.Polygon:
    """A triangle with equal sides, or another whose apex stands above its base."""
    height = 0.5 * np.sqrt(3) if rng.random() < 0.4 else rng.uniform(0.5, 1.4)
    return shapely.Polygon([(-0.5, -height / 3), (0.5, -height / 3), (0.0, 2 * height / 3)])


def regular_polygon(rng: Generator) -> shapely.Polygon:
    """A pentagon to a dodecagon."""
    corners = int(rng.integers(5, 13))
    angles = 2 * np.pi * np.arange(corners) / corners + rng.choice([0.0, np.pi / corners])
    return shapely.Polygon(np.column_stack([np.cos(angles), np.sin(angles)]))


def star(rng: Generator) -> shapely.Polygon:
    """A star of 3 to 8 blunt points, its inner corners at 45 to 80 % of its reach."""
    points, inner = int(rng.integers(3, 9)), rng.uniform(0.45, 0.8)
    angles = np.pi * np.arange(2 * points) / points
    radii = np.where(np.arange(2 * points) % 2 == 0, 1.0, inner)
    return rounded(shapely.Polygon(np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])), 0.06)


def cross(rng: Generator) -> shapely.Polygon:
    """A cross of two bars of equal width, the second 50 to 100 % as long as the first."""
    width, second = rng.uniform(0.22, 0.5), rng.uniform(0.5, 1.0)
    return shapely.union(_box(1.0, width), _box(width, max(second, 1.3 * width)))


def l_shape(rng: Generator) -> shapely.Polygon:
    """Two arms that meet in a corner."""
    width, second = rng.uniform(0.25, 0.5), rng.uniform(0.6, 1.0)
    return _centred(shapely.union(shapely.box(0, 0, 1, width), shapely.box(0, 0, width, second)))


def t_shape(rng: Generator) -> shapely.Polygon:
    """A bar and a stem from its middle."""
    width, stem = rng.uniform(0.22, 0.45), rng.uniform(0.6, 1.1)
    return _centred(shapely.union(_box(1.0, width), shapely.box(-width / 2, 0, width / 2, stem)))


def y_shape(rng: Generator) -> shapely.Polygon:
    """Three arms from one point, at equal angles or with two of them closer."""
    width, opening = rng.uniform(0.25, 0.5), rng.choice([2 * np.pi / 3, rng.uniform(1.2, 2.2)])
    angles = (0.0, np.pi - opening / 2, np.pi + opening / 2)
    arms = [shapely.LineString([(0, 0), (np.cos(a), np.sin(a))]) for a in angles]
    return _centred(shapely.union_all([arm.buffer(width / 2, cap_style="square") for arm in arms]))


def dog_bone(rng: Generator) -> shapely.Polygon:
    """A strip with two wider ends, its shoulders straight or curved."""
    half, waist, end = 0.5 * rng.uniform(1.4, 4.0), 0.5 * rng.uniform(0.3, 0.8), 0.5
    head, flare = half * rng.uniform(0.2, 0.45), half * rng.uniform(0.05, 0.3)
    corners = [(half, 0), (half, end), (half - head, end), (half - head - flare, waist), (0, waist)]
    outline = _mirrored(np.array(corners))
    return rounded(outline, 0.4 * waist) if rng.random() < 0.5 else outline


def i_shape(rng: Generator) -> shapely.Polygon:
    """Two end bars across a web, as wide as half the length or wider (East 2010)."""
    half, end = 0.5 * rng.uniform(1.2, 2.4), 0.5
    waist, flange = end * rng.uniform(0.3, 0.8), half * rng.uniform(0.2, 0.5)
    flare = half * rng.uniform(0.0, 0.2)
    corners = [(half, 0), (half, end), (half - flange, end), (half - flange - flare, waist), (0, waist)]
    return _mirrored(np.array(corners))


def broad_strip(rng: Generator) -> shapely.Polygon:
    """A strip with a broadened middle and narrow ends: the dog bone's opposite."""
    half, end = 0.5 * rng.uniform(1.6, 4.0), 0.5 * rng.uniform(0.35, 0.85)
    middle, flare = half * rng.uniform(0.15, 0.5), half * rng.uniform(0.1, 0.45)
    corners = [(half, 0), (half, end), (min(middle + flare, 0.95 * half), end), (middle, 0.5), (0, 0.5)]
    outline = _mirrored(np.array(corners))
    return rounded(outline, 0.15) if rng.random() < 0.5 else outline


def notched_strip(rng: Generator) -> shapely.Polygon:
    """A strip with a notch cut into each end, or into each side."""
    half, depth, notch = 0.5 * _aspect(rng, 4.0), rng.uniform(0.08, 0.3), rng.uniform(0.15, 0.5)
    strip = _box(2 * half, 1.0)
    if rng.random() < 0.5:
        cuts = [shapely.box(s * half - depth, -notch / 2, s * half + depth, notch / 2) for s in (-1, 1)]
    else:
        cuts = [shapely.box(-notch / 2, s / 2 - depth, notch / 2, s / 2 + depth) for s in (-1, 1)]
    return strip.difference(shapely.union_all(cuts))


def ring(rng: Generator) -> shapely.Polygon:
    """The outer wall of a ring or a plate, round or square; `tether_layouts.holes` makes the holes."""
    return ellipse(rng) if rng.random() < 0.5 else rounded_rectangle(rng)


OUTLINES: dict[str, Callable[[Generator], shapely.Polygon]] = {
    function.__name__: function
    for function in (
        rectangle, rounded_rectangle, pill, ellipse, trapezium, triangle, regular_polygon, star, cross,
        l_shape, t_shape, y_shape, dog_bone, i_shape, broad_strip, notched_strip, ring,
    )
}  # fmt: skip
"""The families by name."""


def irregular(rng: Generator, outline: shapely.Polygon, size: float) -> shapely.Polygon:
    """The outline with each corner moved at random by a share of its width, as in cutting by hand."""
    corners = shapely.get_coordinates(outline.simplify(0.01))[:-1]
    x0, y0, x1, y1 = outline.bounds
    moved = corners + rng.normal(0.0, size * min(x1 - x0, y1 - y0), corners.shape)
    polygon = shapely.Polygon(moved)
    return polygon if polygon.is_valid else outline


def _centred(polygon: shapely.Geometry) -> shapely.Polygon:
    """The polygon with the middle of its bounding box at the origin."""
    x0, y0, x1, y1 = polygon.bounds
    return shapely.transform(polygon, lambda xy: xy - ((x0 + x1) / 2, (y0 + y1) / 2))
