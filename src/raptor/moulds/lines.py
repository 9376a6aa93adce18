"""Open lines of a drawing that close a shape together, as in CAD drawings."""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from raptor.core.errors import RaptorError
from raptor.moulds.shapes import Line, Shape, are_same

GAP, WIDE_GAP = 2e-4, 0.02  # of the drawing's longest side: ends that meet; ends meant to meet


def joined(lines: Sequence[Line], gap: float) -> list[Shape]:
    """The shapes closed by open lines whose ends lie within `gap` of each other."""
    ends = np.array([end for line in lines for end in (line.corners[0], line.corners[-1])])
    knots = _knots(ends, gap)
    met: dict[bytes, tuple[Line, shapely.LineString]] = {}
    for number, line in enumerate(lines):
        corners = line.corners.copy()
        corners[0], corners[-1] = knots[2 * number], knots[2 * number + 1]
        path = shapely.LineString(corners)
        if path.length > 0:
            met.setdefault(path.normalize().wkb, (line, path))  # duplicates count once
    shapes = []
    for polygon in shapely.get_parts(shapely.polygonize([path for _, path in met.values()])):
        rim = polygon.exterior.buffer(1e-6 * polygon.length)
        around = [line for line, path in met.values() if rim.covers(path)]
        role = next((line.role for line in around if line.role), "")
        shapes.append(Shape(around[0].name, shapely.Polygon(polygon.exterior), role))
    return shapes


def _knots(ends: NDArray[np.float64], gap: float) -> NDArray[np.float64]:
    """Ends of lines (n, 2), each moved to the mean of those within `gap` of it."""
    pairs = KDTree(ends).query_pairs(gap, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(ends),) * 2)
    _, knot = connected_components(links, directed=False)
    middles = np.column_stack([np.bincount(knot, ends[:, axis]) for axis in (0, 1)])
    return np.asarray((middles / np.bincount(knot)[:, None])[knot])


def require_closed(lines: Sequence[Line], closed: Sequence[Shape], longest: float) -> None:
    """Raise a RaptorError if lines nearly close an outline, or one of that name is open."""
    if any(shape.role == "outline" for shape in closed):
        return
    nearly = [
        shape
        for shape in joined(lines, WIDE_GAP * longest)
        if not any(are_same(shape, other) for other in closed)
        and all(shape.polygon.envelope.covers(other.polygon) for other in closed)
    ]
    called = [line for line in lines if line.role == "outline"]
    if nearly or called or not closed:
        name = (called or nearly or lines)[0].name
        raise RaptorError(f"no line closes an outline: {_gap(lines, longest) or f'{name} is open'}; close it")


def _gap(lines: Sequence[Line], longest: float) -> str | None:
    """The widest gap between two ends meant to meet, for messages."""
    ends = np.array([end for line in lines for end in (line.corners[0], line.corners[-1])])
    tree = KDTree(ends)
    meet = {int(end) for pair in tree.query_pairs(GAP * longest) for end in pair}
    gaps = [
        (float(np.hypot(*(ends[i] - ends[j]))), i, j)
        for i, j in tree.query_pairs(WIDE_GAP * longest)
        if not {i, j} & meet
    ]
    if not gaps:
        return None
    width, i, j = max(gaps)
    return f"{lines[i // 2].name} and {lines[j // 2].name} end {width:.3g} apart"
