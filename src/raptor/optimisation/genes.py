"""Moulds as vectors of numbers from 0 to 1: a symmetric outline, and tethers in it.

The outline is mirrored in its long axis, along x. Half of its width runs straight from the middle's to the
ends', which may be broader (dog bones, I-shapes) or narrower (broad strips, rhombs), pointed or notched, and
unlike each other (trapezia, triangles). Tethers are posts across the ends, along the rim and in the middle,
and bars across the ends, along the sides and in the middle, as in `tether_layouts`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import shapely
from numpy.typing import NDArray

from raptor.frame import IMAGE_SIZE
from raptor.moulds.families import MARGIN
from raptor.moulds.geometry import Circle, Tether
from raptor.moulds.outlines import LONGEST, rounded
from raptor.moulds.tether_layouts import (
    LARGEST_POST,
    bar,
    bar_across,
    posts_across,
    posts_along,
)
from raptor.optimisation.spec import DesignSpec

GENES = (
    "size", "elongation", "ends", "middle", "flare", "taper", "tip", "rounding",
    "post", "end_posts", "which_end", "end_inset", "end_spread", "rim_posts", "rim_start", "rim_inset",
    "centre", "centre_size", "bars", "bar_length", "bar_inset", "bar_thickness",
)  # fmt: skip
"""What each number of a vector says."""
SEGMENTS = 6  # of a quarter circle of rounded corners
REACH = IMAGE_SIZE / 2 - MARGIN  # l0, from the origin
NARROW, BROAD = 0.08, 2.5  # half width of the ends over that of the middle
MOST_END_POSTS, FEWEST_RIM, MOST_RIM = 4, 4, 12
DEEPEST = 0.45  # of half the length: a point or a notch
SYMMETRIC = 0.25  # gene's distance from its middle within which both ends are alike, and straight
INSET = 0.25  # of the length: farthest an end's tethers stand from the end
THICKEST = 4.0  # l0; of bars
INWARDS = 1e-3  # l0; from the very end of what has room for a post
SLACK = 1e-6  # l0; rounding of gaps


@dataclass(frozen=True)
class Draft:
    """Outline and tethers of a vector, l0; the tethers stand in the outline."""

    outline: shapely.Polygon
    tethers: tuple[Tether, ...]


def draft(vector: NDArray[np.float64], spec: DesignSpec, layers: int) -> Draft:
    """The outline and tethers of a vector (GENES,).

    Raises
    ------
    ValueError
        If the outline is in pieces, or nothing is left of it once its corners are rounded.
    """
    gene = dict(zip(GENES, np.clip(vector, 0.0, 1.0).tolist(), strict=True))
    outline = _outline(gene, spec, layers)
    return Draft(outline, standing(outline, _groups(gene, outline, spec.least), spec.least))


def standing(
    outline: shapely.Polygon, groups: Sequence[Sequence[Tether]], least: Mapping[str, float]
) -> tuple[Tether, ...]:
    """The tethers of each group that are clear of the wall and of earlier groups; none where they crowd.

    A group loses tethers in mirrored pairs, so that symmetric moulds stay so.
    """
    found: list[Tether] = []
    for group in groups:
        kept = [
            tether for tether in group
            if clear(outline, tether) >= least["wall"] - SLACK
            and all(between(tether, other) >= least["gap"] - SLACK for other in found)
        ]  # fmt: skip
        if all(between(one, other) >= least["gap"] - SLACK for one, other in combinations(kept, 2)):
            found += kept
    return tuple(found)


def core(tether: Tether) -> tuple[shapely.Geometry, float]:
    """A shape and a radius about it that make a tether: exact for posts, and far cheaper than polygons."""
    if isinstance(tether, Circle):
        return shapely.Point(tether.x, tether.y), tether.radius
    return tether.polygon, 0.0


def clear(outline: shapely.Polygon, tether: Tether) -> float:
    """Gap between a tether and the wall, l0; negative where it reaches out."""
    shape, radius = core(tether)
    distance = outline.exterior.distance(shape)
    return float((distance if outline.contains(shape) else -distance) - radius)


def between(one: Tether, other: Tether) -> float:
    """Gap between two tethers, l0; negative where two posts overlap."""
    (first, r), (second, s) = core(one), core(other)
    return float(first.distance(second) - r - s)


def profile(gene: dict[str, float]) -> shapely.Polygon:
    """The outline before it is rounded and scaled: its length is the aspect, its width 1."""
    half = 0.5 * _between(gene["elongation"], 1.0, LONGEST)
    ends, skew = _between(gene["ends"], NARROW, BROAD), _centred(gene["taper"])
    left, right = ends * np.exp(-1.2 * skew), ends * np.exp(1.2 * skew)
    widest = max(1.0, left, right)
    tip = DEEPEST * half * _centred(gene["tip"])
    shoulder = half - max(tip, 0.0)
    flat = 0.9 * gene["middle"] * shoulder
    slope = flat + gene["flare"] * (shoulder - flat)
    above = [(-shoulder, left), (-slope, left), (-flat, 1.0), (flat, 1.0), (slope, right), (shoulder, right)]
    upper = np.array([(x, 0.5 * y / widest) for x, y in above])
    point = np.array([(shoulder + tip, 0.0)])
    corners = [-point, upper, point, (upper * (1, -1))[::-1]]
    return shapely.Polygon(np.concatenate(corners)).buffer(0)


def _outline(gene: dict[str, float], spec: DesignSpec, layers: int) -> shapely.Polygon:
    """The outline, rounded, as large as its gene says or as the frame allows, about the origin.

    Parts too narrow for the process are cut off.
    """
    area = _between(gene["size"], *map(float, spec.mould_cells)) / layers
    neck = spec.least["neck"] / 2
    polygon = _sized(profile(gene), area)
    polygon = polygon.buffer(-neck, join_style="mitre").buffer(neck, join_style="mitre")  # without slivers
    radius = max(spec.least["corner"], 0.25 * np.sqrt(area) * max(0.0, gene["rounding"] - 0.5))
    if radius > 0:
        polygon = rounded(polygon, radius, SEGMENTS)
    if polygon.is_empty or polygon.geom_type != "Polygon" or polygon.interiors:
        raise ValueError("the outline is in pieces")
    return _sized(polygon, area).simplify(1e-3)


def _sized(polygon: shapely.Polygon, area: float) -> shapely.Polygon:
    """A polygon scaled to an area, l0^2, or to the frame, with the middle of its length at the origin."""
    x0, y0, x1, y1 = polygon.bounds
    scale = min(np.sqrt(area / polygon.area), 2 * REACH / max(x1 - x0, y1 - y0))
    return shapely.transform(polygon, lambda xy: scale * (xy - ((x0 + x1) / 2, 0.0)))


def _groups(gene: dict[str, float], outline: shapely.Polygon, least: dict[str, float]) -> list[list[Tether]]:
    """Proposed tethers in groups, each mirrored like the outline."""
    x0, y0, x1, y1 = outline.bounds
    length, width = x1 - x0, y1 - y0
    thinnest, wall = least["post"] / 2, least["wall"]
    radius = _between(gene["post"], thinnest, max(thinnest, min(LARGEST_POST, width / 6)))
    thick = _between(gene["bar_thickness"], 2 * thinnest, max(2 * thinnest, min(THICKEST, width / 4)))
    inner = outline.buffer(-(radius + wall))
    groups = [_in_the_middle(gene, length, width, radius, thick), _bars(gene, outline, thick, wall)]
    return [*groups, _at_ends(gene, inner, radius, length, width), _on_rim(gene, inner, radius, width)]


def _at_ends(
    gene: dict[str, float], inner: shapely.Geometry, radius: float, length: float, width: float
) -> list[Tether]:
    """Posts across both ends or one, their centres in the part of the outline that has room for them."""
    count = _whole(gene["end_posts"], MOST_END_POSTS)
    if not count or inner.is_empty:
        return []
    inset, closer = INSET * length * gene["end_inset"], 0.25 * (1 - gene["end_spread"]) * width
    left, _, right, _ = inner.bounds
    ends = _chosen(gene["which_end"], left + inset + INWARDS, right - inset - INWARDS)
    return [post for x in ends for post in posts_across(inner, x, count, radius, closer - radius)]


def _on_rim(gene: dict[str, float], inner: shapely.Geometry, radius: float, width: float) -> list[Tether]:
    """Posts evenly along the wall, the first on the long axis or half a step from it."""
    line = inner.buffer(-0.25 * width * gene["rim_inset"])
    if gene["rim_posts"] < 0.6 or line.is_empty or line.geom_type != "Polygon":
        return []
    count = FEWEST_RIM + _whole((gene["rim_posts"] - 0.6) / 0.4, MOST_RIM - FEWEST_RIM)
    start = line.exterior.project(shapely.Point(line.bounds[2], 0.0), normalized=True)
    return posts_along(line.exterior, count, start + round(gene["rim_start"]) / 2 / count, radius)


def _in_the_middle(
    gene: dict[str, float], length: float, width: float, radius: float, thick: float
) -> list[Tether]:
    """Nothing, a post, a bar along the mould or one across it."""
    kind, size = _whole((gene["centre"] - 0.5) / 0.5, 2), gene["centre_size"]
    if gene["centre"] <= 0.5:
        return []
    if kind == 0:
        return [Circle(0.0, 0.0, _between(size, radius, max(radius, 0.3 * width)))]
    share = 0.2 + 0.55 * size
    return [bar(0.0, 0.0, share * length, thick) if kind == 1 else bar(0.0, 0.0, thick, share * width)]


def _bars(gene: dict[str, float], outline: shapely.Polygon, thick: float, wall: float) -> list[Tether]:
    """Nothing, a bar across each end, or one along each side."""
    if gene["bars"] <= 0.6:
        return []
    x0, y0, x1, y1 = outline.bounds
    share, inset = 0.2 + 0.75 * gene["bar_length"], thick / 2 + wall
    if gene["bars"] <= 0.8:
        inset += INSET * (x1 - x0) * gene["bar_inset"]
        return [each for x in (x0 + inset, x1 - inset) for each in bar_across(outline, x, thick, share)]
    inset += 0.3 * (y1 - y0) * gene["bar_inset"]
    return [bar(0.0, side, share * (x1 - x0), thick) for side in (y0 + inset, y1 - inset)]


def _between(gene: float, low: float, high: float) -> float:
    """A length between two, its logarithm uniform."""
    return float(low * (high / low) ** gene)


def _centred(gene: float) -> float:
    """From -1 to 1, and 0 in the middle half, so that symmetric moulds are not a rarity."""
    off = gene - 0.5
    return float(np.sign(off) * max(0.0, abs(off) - SYMMETRIC / 2) / (0.5 - SYMMETRIC / 2))


def _whole(gene: float, most: int) -> int:
    """A whole number from 0 to the most."""
    return min(int(gene * (most + 1)), most)


def _chosen(gene: float, left: float, right: float) -> tuple[float, ...]:
    """Both ends, or one of them."""
    return (left, right) if gene < 0.6 else (left,) if gene < 0.8 else (right,)
