"""Layouts of tethers as people place them: posts, bars, blocks and holes, one function per layout.

Each takes a generator and the outline and proposes tethers; the caller keeps those that fit in the outline
with gaps between them (`families`). What a layout draws and where that puts its tethers are two functions
where a search (`raptor.optimisation`) needs the second alone.
"""

from collections.abc import Callable
from itertools import product

import numpy as np
import shapely
from numpy.random import Generator
from shapely.affinity import rotate, translate

from raptor.moulds.geometry import Circle, PolygonTether, Tether

SMALLEST_POST, LARGEST_POST = 0.8, 9.0  # radius, l0
WALL = 1.2  # l0; least distance of a post from the wall


def _post_radius(rng: Generator, width: float) -> float:
    """Radius of a post: its logarithm is uniform up to a sixth of the mould's width."""
    largest = min(LARGEST_POST, max(width / 6, 1.3 * SMALLEST_POST))
    return float(np.exp(rng.uniform(np.log(SMALLEST_POST), np.log(largest))))


def _extent(outline: shapely.Polygon) -> tuple[float, float]:
    """Length and width of the outline, along x and y."""
    x0, y0, x1, y1 = outline.bounds
    return x1 - x0, y1 - y0


def _across(outline: shapely.Polygon, x: float) -> tuple[float, float] | None:
    """Lowest and highest y of the outline's longest piece on a line across it at x; None outside."""
    length, width = _extent(outline)
    line = shapely.LineString([(x, -length - width), (x, length + width)]).intersection(outline)
    pieces = [piece for piece in getattr(line, "geoms", [line]) if piece.length > 0]
    if not pieces:
        return None
    longest = max(pieces, key=lambda piece: piece.length)
    return longest.bounds[1], longest.bounds[3]


def none(rng: Generator, outline: shapely.Polygon) -> list[Tether]:
    """No tether: a gel that contracts freely."""
    return []


def corners(rng: Generator, outline: shapely.Polygon) -> list[Tether]:
    """A post in each corner of the outline, or in its vertices at most eight."""
    radius = _post_radius(rng, min(_extent(outline)))
    inset = radius + rng.uniform(WALL, 3.5)
    inner = outline.buffer(-inset, join_style="mitre").simplify(0.3)
    if inner.is_empty or inner.geom_type != "Polygon":
        return []
    points = shapely.get_coordinates(inner)[:-1]
    if len(points) > 8:
        points = shapely.get_coordinates(shapely.oriented_envelope(inner))[:-1]
    return [Circle(float(x), float(y), radius) for x, y in points]


def ends(rng: Generator, outline: shapely.Polygon) -> list[Tether]:
    """One to five posts across each end."""
    length, width = _extent(outline)
    count, radius = int(rng.integers(1, 6)), _post_radius(rng, min(length, width))
    inset = radius + rng.uniform(WALL, 0.2 * length)
    ends = (inset - length / 2, length / 2 - inset)
    return [post for x in ends for post in posts_across(outline, x, count, radius, WALL)]


def posts_across(outline: shapely.Polygon, x: float, count: int, radius: float, wall: float) -> list[Tether]:
    """Posts evenly across the outline at x, the outer ones at a distance from the wall."""
    span = _across(outline, x)
    if span is None:
        return []
    low, high = span[0] + radius + wall, span[1] - radius - wall
    places = [(low + high) / 2] if count == 1 else np.linspace(low, high, count)
    return [Circle(float(x), float(y), radius) for y in places]


def rim(rng: Generator, outline: shapely.Polygon) -> list[Tether]:
    """Four to sixteen posts at equal distances along the wall."""
    radius = _post_radius(rng, min(_extent(outline)))
    inner = outline.buffer(-radius - rng.uniform(WALL, 4.0))
    if inner.is_empty or inner.geom_type != "Polygon":
        return []
    count, start = int(rng.integers(4, 17)), rng.random()
    return posts_along(inner.exterior, count, start, radius)


def posts_along(line: shapely.LinearRing, count: int, start: float, radius: float) -> list[Tether]:
    """Posts at equal distances along a closed line, the first at a share of its length."""
    places = [line.interpolate((start + k / count) % 1, normalized=True) for k in range(count)]
    return [Circle(point.x, point.y, radius) for point in places]


def grid(rng: Generator, outline: shapely.Polygon) -> list[Tether]:
    """Posts on a square or staggered grid, or in one row."""
    radius = _post_radius(rng, min(_extent(outline)))
    gap = 2 * radius + rng.uniform(2.5, 10.0)
    length, width = _extent(outline)
    rows = 1 if rng.random() < 0.3 else max(1, int(width / gap))
    columns, shift = max(1, int(length / gap)), gap / 2 * (rng.random() < 0.3)
    return [
        Circle((c - (columns - 1) / 2) * gap + shift * (r % 2), (r - (rows - 1) / 2) * gap, radius)
        for r, c in product(range(rows), range(columns))
    ]


def circle(rng: Generator, outline: shapely.Polygon) -> list[Tether]:
    """Three to ten posts on a circle about the middle."""
    width = min(_extent(outline))
    count, radius = int(rng.integers(3, 11)), _post_radius(rng, width)
    reach, start = width * rng.uniform(0.2, 0.42), rng.choice([0.0, rng.uniform(0, 2 * np.pi)])
    angles = start + 2 * np.pi * np.arange(count) / count
    return [Circle(float(reach * np.cos(a)), float(reach * np.sin(a)), radius) for a in angles]


def middle(rng: Generator, outline: shapely.Polygon) -> list[Tether]:
    """One post, thick or thin, in the middle."""
    largest = min(LARGEST_POST, 0.35 * min(_extent(outline)))
    return [Circle(0.0, 0.0, float(rng.uniform(SMALLEST_POST, max(largest, 1.0))))]


def holes(rng: Generator, outline: shapely.Polygon) -> list[Tether]:
    """The hole of a ring, or two to four large holes of a plate; round or square."""
    length, width = _extent(outline)
    count = 1 if rng.random() < 0.6 else int(rng.integers(2, 5))
    size = rng.uniform(0.2, 0.36) * min(width, length / count)
    square = rng.random() < 0.3
    places = (np.arange(count) - (count - 1) / 2) * length / count
    box = shapely.box(-size, -size, size, size)
    return [
        PolygonTether(translate(box, x, 0.0)) if square else Circle(float(x), 0.0, float(size))
        for x in places
    ]


def end_bars(rng: Generator, outline: shapely.Polygon) -> list[Tether]:
    """A bar across each end, 40 to 97 % as long as the end is wide, at times against the end wall."""
    length, _ = _extent(outline)
    thick, share = _bar_thickness(rng, length), rng.uniform(0.4, 0.97)
    inset = thick / 2 + (0.0 if rng.random() < 0.1 else rng.uniform(WALL, 0.15 * length))
    ends = (inset - length / 2, length / 2 - inset)
    return [each for x in ends for each in bar_across(outline, x, thick, share)]


def bar_across(outline: shapely.Polygon, x: float, thick: float, share: float) -> list[Tether]:
    """A bar across the outline at x, as long as a share of its width there; none outside."""
    span = _across(outline, x)
    if span is None:
        return []
    middle, half = (span[0] + span[1]) / 2, share * (span[1] - span[0]) / 2
    return [bar(x, middle, thick, 2 * half)]


def side_bars(rng: Generator, outline: shapely.Polygon) -> list[Tether]:
    """A bar along each long side, 20 to 90 % as long as the mould."""
    length, width = _extent(outline)
    thick, reach = _bar_thickness(rng, width), length * rng.uniform(0.2, 0.9)
    y = width / 2 - thick / 2 - rng.uniform(WALL, 0.15 * width + WALL)
    return [bar(0.0, s * y, reach, thick) for s in (-1, 1)]


def middle_bar(rng: Generator, outline: shapely.Polygon) -> list[Tether]:
    """One bar in the middle, along the mould or across it."""
    length, width = _extent(outline)
    thick, share = _bar_thickness(rng, width), rng.uniform(0.2, 0.75)
    return [
        bar(0.0, 0.0, share * length, thick) if rng.random() < 0.6 else bar(0.0, 0.0, thick, share * width)
    ]


def blocks(rng: Generator, outline: shapely.Polygon) -> list[Tether]:
    """Square or L-shaped blocks where `corners` puts its posts."""
    posts = [post for post in corners(rng, outline) if isinstance(post, Circle)]
    if not posts:
        return []
    side, angular = max(posts[0].radius, 1.0), rng.random() < 0.5
    block = shapely.box(-side, -side, side, side)
    if angular and side > 1.6:
        block = block.difference(shapely.box(0.0, 0.0, 2 * side, 2 * side))
    return [
        PolygonTether(
            translate(rotate(block, 90 * (np.arctan2(p.y, p.x) // (np.pi / 2)), origin=(0, 0)), p.x, p.y)
        )
        for p in posts
    ]


def mixture(rng: Generator, outline: shapely.Polygon) -> list[Tether]:
    """Two other layouts together; what does not fit beside the first is left out."""
    first, second = rng.choice(SIMPLE, 2, replace=False)
    return LAYOUTS[str(first)](rng, outline) + LAYOUTS[str(second)](rng, outline)


def _bar_thickness(rng: Generator, room: float) -> float:
    """Thickness of a bar, l0: thin ones as common as thick ones, at most a quarter of the room."""
    return float(np.exp(rng.uniform(np.log(1.0), np.log(max(1.5, min(6.0, room / 4))))))


def bar(x: float, y: float, length: float, width: float) -> PolygonTether:
    """A bar about (x, y), its length along x."""
    return PolygonTether(shapely.box(x - length / 2, y - width / 2, x + length / 2, y + width / 2))


LAYOUTS: dict[str, Callable[[Generator, shapely.Polygon], list[Tether]]] = {
    function.__name__: function
    for function in (
        none, corners, ends, rim, grid, circle, middle, holes, end_bars, side_bars, middle_bar, blocks,
        mixture,
    )
}  # fmt: skip
"""The layouts by name."""
SIMPLE = [name for name in LAYOUTS if name not in ("none", "mixture", "holes")]
