"""Closed paths of sites around a tether as cast, which hold the tissue on it."""

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from raptor.moulds.geometry import Tether

NEARER = 1e-6  # of a step, per l0^2 from the centre: among equal paths, prefer that of the nearest sites


def centre_of(tether: Tether) -> NDArray[np.float64]:
    """The centre (2,) of a tether, l0: its centroid, or a point well inside if that lies outside."""
    polygon = tether.polygon
    centre = polygon.centroid if polygon.contains(polygon.centroid) else shapely.point_on_surface(polygon)
    return np.array([centre.x, centre.y])


def smallest_loop(plane: NDArray[np.float64], centre: NDArray[np.float64]) -> NDArray[np.intp] | None:
    """The smallest closed path, one lattice step each, through sites (n, 2) of a layer around a point.

    Every site is doubled, and a step across the ray from the point along x leads from one copy to the other.
    A path from a site to its own copy winds around the point an odd number of times, and the shortest one
    once.

    Returns
    -------
    ndarray (m,) or None
        Indices of sites along the path; None if no path encloses the point.
    """
    count = len(plane)
    first, second, across = _steps(plane, centre)
    length = 1 + NEARER * (((plane[first] + plane[second]) / 2 - centre) ** 2).sum(axis=1)
    start = np.concatenate([first, first + count])
    end = np.concatenate([second + count * across, second + count * ~across])
    graph = coo_array((np.tile(length, 2), (start, end)), shape=(2 * count, 2 * count)).tocsr()
    best, least = None, np.inf
    for site in first[across][np.argsort(plane[first[across], 0])]:
        if least < np.inf and plane[site, 0] - centre[0] > least / 2:
            break
        distance, before = dijkstra(
            graph, directed=False, indices=site, limit=least, return_predecessors=True
        )
        if distance[site + count] < least:
            least, best = distance[site + count], _path(before, int(site), int(site) + count) % count
    return best


def _steps(
    plane: NDArray[np.float64], centre: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]]:
    """Every lattice step between sites, (first, second), and whether it crosses the ray along x."""
    number = {(x, y): i for i, (x, y) in enumerate(plane.tolist())}
    pairs = [
        (i, number[other])
        for (x, y), i in number.items()
        for other in ((x + 1, y), (x, y + 1))
        if other in number
    ]
    first, second = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
    (x, low), high = plane[first].T, plane[second, 1]
    return first, second, (x > centre[0]) & (low <= centre[1]) & (centre[1] < high)


def _path(before: NDArray[np.int32], start: int, end: int) -> NDArray[np.intp]:
    """Nodes along the path that ends at a node, from each node's predecessor, without the start."""
    path = [end]
    while before[path[-1]] != start:
        path.append(int(before[path[-1]]))
    return np.array(path, dtype=np.intp)


def winding(points: NDArray[np.float64], centre: NDArray[np.float64]) -> int:
    """Winding number of a closed path through points (n, 2) about a centre, counter-clockwise."""
    x, y = (points - centre).T
    next_x, next_y = np.roll(x, -1), np.roll(y, -1)
    turns = np.arctan2(x * next_y - y * next_x, x * next_x + y * next_y)
    return round(float(turns.sum()) / (2 * np.pi))
