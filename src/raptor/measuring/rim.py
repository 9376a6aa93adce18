"""Registration by the rim: the edge of the depression, which looks unlike the plate around it.

What is not plate gives a first position, size and direction; then edges are sought across the
outline and the tethers as they would lie in the picture, and the similarity is fitted to them (the
search of active shape models: Cootes, Taylor, Cooper and Graham 1995, Comput. Vis. Image Underst. 61, 38).
"""

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import binary_fill_holes, binary_opening, label, map_coordinates
from scipy.optimize import least_squares
from skimage.measure import find_contours

from raptor.errors import RaptorError
from raptor.measuring.light import find_plate, log_brightness
from raptor.measuring.registration import Registration
from raptor.moulds import Mould

SMOOTHING = 1.5  # pixels
ANGLES = 120  # directions tried
SPACING = 0.25  # l0, between points on the mould's edges
CORNER = 0.6  # l0 around a corner, where blur moves the edge
REACHES = (2.0, 1.0, 0.6, 0.6)  # l0 to either side in which an edge is sought, in turn
EDGE = 6.0  # times the plate's slopes: the least slope of an edge
MIN_OVERLAP = 0.85  # of the region found and the outline, intersection over union
MIN_SEEN = 0.6  # of the rim
NEAR = 0.3  # l0; an edge counts as the mould's within it
MAX_RESIDUAL = 0.15  # l0, root mean square of the edges that count
ADVICE = "show the whole mould with plate around it, or give --landmark or --aligned"


@dataclass(frozen=True)
class Edges:
    """Points (n, 2) on the mould's edges, their normals (n, 2), and which are the rim's; l0."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    rim: NDArray[np.bool_]


def find_rim(values: NDArray[np.float64], mould: Mould, mirrored: bool = False) -> Registration:
    """Register a photograph (row, column) by the rim of the depression.

    Raises
    ------
    RaptorError
        Where no rim is seen, or what is seen does not have the mould's shape.
    """
    log = log_brightness(values, SMOOTHING)
    plate, flat, _ = find_plate(log)
    start = _overlay_region(_region(plate), mould, mirrored)
    slopes = np.hypot(*np.gradient(flat))
    least = EDGE * float(np.median(slopes[plate]))
    edges = mould_edges(mould)
    found = start
    for reach in REACHES:
        offsets = _edge_offsets(flat, edges, found, reach, least)
        found = _fit(found, edges, offsets)
    offsets = _edge_offsets(flat, edges, found, REACHES[-1], least)
    near = np.abs(offsets) < NEAR
    seen = float(near[edges.rim].mean())
    residual = float(np.sqrt(np.mean(offsets[near] ** 2))) if near.any() else np.inf
    if seen < MIN_SEEN or residual > MAX_RESIDUAL:
        raise RaptorError(
            f"{mould.name} cannot be registered: {100 * seen:.0f} % of its rim is seen with a residual of "
            f"{residual:.2f} l0; {100 * MIN_SEEN:.0f} % and {MAX_RESIDUAL} l0 are needed, so {ADVICE}"
        )
    return Registration(found.matrix, "rim", residual)


def mould_edges(mould: Mould) -> Edges:
    """Points every 0.25 l0 along the outline and the tethers, away from corners."""
    parts = [_edge_points(mould.outline), *(_edge_points(tether.polygon) for tether in mould.tethers)]
    rim = np.repeat(np.arange(len(parts)) == 0, [len(points) for points, _ in parts])
    points, normals = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return Edges(points, normals, rim)


def _edge_points(polygon: shapely.Polygon) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    ring = polygon.exterior
    along = np.arange(0.5 * SPACING, ring.length, SPACING)
    at, before, after = (
        shapely.get_coordinates(shapely.line_interpolate_point(ring, (along + step) % ring.length))
        for step in (0.0, -CORNER, CORNER)
    )
    ahead, behind = after - at, at - before
    tangent = ahead + behind
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    # A tether's curve turns too, but less than a corner does.
    cosine = np.sum(ahead * behind, axis=1) / np.linalg.norm(ahead, axis=1) / np.linalg.norm(behind, axis=1)
    straight = cosine > 0.8
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
    return at[straight], normal[straight]


def _region(plate: NDArray[np.bool_]) -> shapely.Polygon:
    """The largest thing that is not plate, holes filled, as a polygon (column, row)."""
    there = binary_fill_holes(binary_opening(~plate, iterations=2))
    pieces, count = label(there)
    if count == 0:
        raise RaptorError(f"no mould is seen: the image shows one surface; {ADVICE}")
    sizes = np.bincount(pieces.ravel())
    sizes[0] = 0
    largest = np.pad(pieces == sizes.argmax(), 1)
    contour = max(find_contours(largest.astype(float), 0.5), key=len) - 1
    return shapely.Polygon(contour[:, ::-1]).buffer(0).simplify(0.5)


def _overlay_region(region: shapely.Polygon, mould: Mould, mirrored: bool) -> Registration:
    """The mould's outline with the region's area and centre, in the direction of most overlap."""
    scale = np.sqrt(region.area / mould.outline.area)
    flip = np.diag([1.0, 1.0 if mirrored else -1.0])
    centre, middle = (shapely.get_coordinates(shape.centroid)[0] for shape in (region, mould.outline))
    best, found = 0.0, None
    for angle in np.arange(ANGLES) * 2 * np.pi / ANGLES:
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        linear = scale * turn @ flip
        matrix = np.eye(3)
        matrix[:2, :2], matrix[:2, 2] = linear, centre - linear @ middle
        candidate = Registration(matrix, "rim", float("nan"))
        shape = shapely.transform(mould.outline, candidate.to_pixels)
        common = shape.intersection(region).area
        overlap = common / (shape.area + region.area - common)
        if overlap > best + 1e-3:  # of a symmetric mould, the first direction
            best, found = overlap, candidate
    if found is None or best < MIN_OVERLAP:
        raise RaptorError(
            f"what is seen does not have the shape of {mould.name}: it overlaps with it by "
            f"{100 * best:.0f} %, at least {100 * MIN_OVERLAP:.0f} % is needed; {ADVICE}"
        )
    return found


def _edge_offsets(
    flat: NDArray[np.float64], edges: Edges, registration: Registration, reach: float, least: float
) -> NDArray[np.float64]:
    """How far along its normal each edge point (n,) meets the steepest slope, l0; NaN without one."""
    step = 0.5 / registration.scale
    count = int(np.ceil(reach / step)) + 1
    along = np.arange(-count, count + 1) * step
    points = edges.points[:, None] + along[:, None] * edges.normals[:, None]
    columns, rows = np.moveaxis(registration.to_pixels(points.reshape(-1, 2)).reshape(points.shape), -1, 0)
    profile = map_coordinates(flat, [rows, columns], order=1, mode="nearest")
    slope = np.abs(np.gradient(profile, 0.5, axis=1))  # per pixel
    top = 1 + slope[:, 1:-1].argmax(axis=1)
    each = np.arange(len(top))
    left, middle, right = (slope[each, top + k] for k in (-1, 0, 1))
    curvature = left - 2 * middle + right
    shift = np.where(curvature < 0, 0.5 * (left - right) / np.where(curvature < 0, curvature, 1.0), 0.0)
    offsets = along[top] + np.clip(shift, -1, 1) * step
    ends = (top == 1) | (top == slope.shape[1] - 2)  # still rising at the end: not this edge
    return np.where((middle > least) & ~ends, offsets, np.nan)


def _fit(registration: Registration, edges: Edges, offsets: NDArray[np.float64]) -> Registration:
    """The similarity that brings the edge points to the edges found, robustly."""
    there = np.isfinite(offsets)
    if there.sum() < 8:
        return registration
    points, normals, wanted = edges.points[there], edges.normals[there], offsets[there]

    def misses(change: NDArray[np.float64]) -> NDArray[np.float64]:
        a, b, dx, dy = change
        moved = np.column_stack([a * points[:, 0] - b * points[:, 1] + dx, b * points[:, 0] + a * points[:, 1] + dy])
        return np.asarray(np.sum(moved * normals, axis=1) - wanted)

    a, b, dx, dy = least_squares(misses, np.zeros(4), loss="cauchy", f_scale=0.1).x
    change = np.array([[1 + a, -b, dx], [b, 1 + a, dy], [0, 0, 1]])
    return Registration(registration.matrix @ change, registration.method, registration.residual)
