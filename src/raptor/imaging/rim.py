"""Registration by the rim, the edge between the depression and the plate around it.

The region that is not plate gives an initial position, size and orientation. Edges are then searched for
across the outline and tethers, and the similarity is fitted to them, as in active shape models (Cootes,
Taylor, Cooper and Graham 1995, Comput. Vis. Image Underst. 61, 38).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import (
    binary_closing,
    binary_erosion,
    binary_fill_holes,
    binary_opening,
    label,
    map_coordinates,
)
from scipy.optimize import least_squares
from scipy.signal import find_peaks
from skimage.measure import find_contours
from skimage.segmentation import watershed

from raptor.core.errors import RaptorError
from raptor.imaging.illumination import find_plate, log_brightness
from raptor.imaging.registration import Registration, RegistrationError
from raptor.moulds import Mould

SMOOTHING = 1.5  # pixels
ANGLES = 120  # orientations tried
SPACING = 0.25  # l0, between points on the mould's edges
CORNER = 0.6  # l0 around a corner, where blur moves the edge
WIDE, CLOSE = (2.5, 1.0, 1.0), (0.6, 0.4, 0.4)  # l0, successive search distances to either side
BLURRED = 6  # pixels over which brightness changes from plate to floor
GAP = 4  # pixels; plate-like regions this narrow are not plate
EDGE = 6.0  # smallest slope of an edge, relative to the slopes of the plate
MIN_OVERLAP = 0.85, 0.95  # between the region found and the outline, before and after the fit
MIN_SEEN = 0.6  # share of the rim that must be visible
NEAR = 0.3  # l0; edges within this distance belong to the mould
MAX_RESIDUAL = 0.1  # l0, root mean square over those edges
BAND = 0.9  # l0 to either side of the rim where a second edge is refused
BAND_PART = 0.35  # share of the rim along which a second edge counts
SECOND_EDGE = 0.2  # its slope, relative to the rim's
MIN_SCALE = 8.0  # pixels per l0; needed to separate a tissue near the rim from it
ALIKE = 0.02  # overlaps this near tell nothing about direction
DIRECTIONS = 0.16  # radians between directions that are tried, of which at most
TRIED = 8
UNCLEAR = 0.1  # share of the tethers' edges; differences this small do not tell directions apart
SAME = 0.8  # share of the tethers that directions alike by symmetry have in common
ADVICE = "show the whole mould with plate around it, try --mirrored, or give --landmark or --aligned"


@dataclass(frozen=True)
class Edges:
    """Points (n, 2) on the mould's edges, their normals (n, 2), and which are the rim's; l0."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    rim: NDArray[np.bool_]

    def only(self, there: NDArray[np.bool_]) -> "Edges":
        """Some of them, (n,)."""
        return Edges(self.points[there], self.normals[there], self.rim[there])


def find_rim(values: NDArray[np.float64], mould: Mould, mirrored: bool = False) -> Registration:
    """Register a photograph (row, column) by the rim of the depression.

    Raises
    ------
    RaptorError
        If no rim is visible, or what is visible does not have the mould's shape.
    """
    plate, flat, _ = find_plate(log_brightness(values, SMOOTHING))
    # Brightness itself: the steepest slope of its logarithm lies on the dark side of an edge.
    even = np.exp(flat)
    slopes = np.hypot(*np.gradient(even))
    region = _region(plate, slopes)
    polygon = _as_polygon(region)
    edges = mould_edges(mould)
    rim, tethers = edges.only(edges.rim), edges.only(~edges.rim)
    least = EDGE * float(np.median(slopes[plate]))

    def fitted(pose: Registration) -> Registration:
        # First the boundary of the region alone: a tissue near the rim has stronger edges.
        for reach in WIDE:
            pose = _fit(pose, rim, _edge_offsets(region.astype(float), rim, pose, reach, 0.1))
        for reach in CLOSE:
            pose = _fit(pose, edges, _edge_offsets(even, edges, pose, reach, least))
        return pose

    def seen(pose: Registration, reach: float) -> float:
        """Share of the tethers' edges that are seen where a pose has them."""
        offsets = _edge_offsets(even, tethers, pose, 1.5 * reach, least)
        return float(np.mean(np.abs(offsets) < reach)) if len(offsets) else 0.0

    starts = _apart(_starts(polygon, mould, mirrored), lambda pose: seen(pose, WIDE[-1]))
    found = _told_by_tethers([fitted(start) for start in starts], lambda pose: seen(pose, NEAR), mould)
    if found.scale < MIN_SCALE:
        raise RegistrationError(
            f"the mould is too small in the image: {found.scale:.1f} pixels per l0, at least {MIN_SCALE:g} "
            "are needed; photograph it from closer, crop the image around it, or give --landmark",
            found,
        )
    _require_overlap(found, MIN_OVERLAP[1], mould, polygon)
    offsets = _edge_offsets(even, rim, found, CLOSE[-1], least)
    near = np.abs(offsets) < NEAR
    residual = float(np.sqrt(np.mean(offsets[near] ** 2))) if near.any() else np.inf
    if near.mean() < MIN_SEEN or residual > MAX_RESIDUAL:
        raise RegistrationError(
            f"{mould.name} cannot be registered: {100 * near.mean():.0f} % of its rim is visible (at least "
            f"{100 * MIN_SEEN:.0f} % is needed) with a residual of {residual:.2f} l0 (at most {MAX_RESIDUAL} "
            f"is allowed); {ADVICE}",
            found,
        )
    _require_one_edge(even, rim, found, mould)
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
    # A tether's edge bends too, but less than a corner.
    cosine = np.sum(ahead * behind, axis=1) / np.linalg.norm(ahead, axis=1) / np.linalg.norm(behind, axis=1)
    straight = cosine > 0.8
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
    return at[straight], normal[straight]


def _region(plate: NDArray[np.bool_], slopes: NDArray[np.float64]) -> NDArray[np.bool_]:
    """The largest region (row, column) that is not plate, gaps filled, out to the steepest slope."""
    there = binary_opening(np.pad(~plate, GAP), iterations=2)
    there = binary_fill_holes(binary_closing(there, iterations=GAP))[GAP:-GAP, GAP:-GAP]
    pieces, _ = label(there)
    sizes = np.bincount(pieces.ravel())
    sizes[0] = 0
    largest = pieces == sizes.argmax()
    core = binary_erosion(largest, iterations=BLURRED) & (sizes.max() > 0)
    if not core.any():
        raise RaptorError(f"no mould is visible: the image shows one surface; {ADVICE}")
    markers = np.where(core, 1, 0) + np.where(largest, 0, 2)
    return np.asarray(watershed(slopes, markers) == 1)


def _as_polygon(region: NDArray[np.bool_]) -> shapely.Polygon:
    """The boundary of a region (row, column), as a polygon (column, row)."""
    contour = max(find_contours(np.pad(region, 1).astype(float), 0.5), key=len) - 1
    return shapely.Polygon(contour[:, ::-1]).buffer(0).simplify(0.5)


def _starts(region: shapely.Polygon, mould: Mould, mirrored: bool) -> list[Registration]:
    """The mould's outline with the region's area and centre, in the directions of most overlap.

    Of those that overlap alike, as a symmetric outline's do, the least turn comes first.
    """
    scale = np.sqrt(region.area / mould.outline.area)
    flip = np.diag([1.0, 1.0 if mirrored else -1.0])
    centre, middle = (shapely.get_coordinates(shape.centroid)[0] for shape in (region, mould.outline))
    poses = []
    for angle in sorted(np.arange(-ANGLES // 2, ANGLES // 2) * 2 * np.pi / ANGLES, key=abs):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        matrix = np.eye(3)
        matrix[:2, :2] = scale * turn @ flip
        matrix[:2, 2] = centre - matrix[:2, :2] @ middle
        poses.append(Registration(matrix, "rim", float("nan")))
    overlaps = np.array([_overlap(pose, mould, region) for pose in poses])
    _require_overlap(poses[overlaps.argmax()], MIN_OVERLAP[0], mould, region)
    order = np.argsort(-np.round(overlaps, 3), kind="stable")
    return [poses[number] for number in order if overlaps[number] > overlaps.max() - ALIKE]


def _apart(poses: list[Registration], seen: Callable[[Registration], float]) -> list[Registration]:
    """A few poses in different directions, in which most of the tethers is seen; their order is kept."""
    shares = np.round([seen(pose) for pose in poses], 1)
    chosen: list[int] = []
    for number in np.argsort(-shares, kind="stable").tolist():
        turns = [abs(_turn(poses[number], poses[other])) for other in chosen]
        if min(turns, default=np.inf) > DIRECTIONS:
            chosen.append(number)
    return [poses[number] for number in sorted(chosen[:TRIED])]


def _told_by_tethers(
    poses: list[Registration], seen: Callable[[Registration], float], mould: Mould
) -> Registration:
    """The pose in which the tethers are seen; of those alike by the mould's own symmetry, the first."""
    shares = np.array([seen(pose) for pose in poses])
    close = [pose for pose, share in zip(poses, shares, strict=True) if share > shares.max() - UNCLEAR]
    posts = shapely.union_all([tether.polygon for tether in mould.tethers])
    for other in close[1:]:
        moved = shapely.transform(shapely.transform(posts, other.to_pixels), close[0].to_mould)
        if moved.intersection(posts).area < SAME * posts.area:
            raise RegistrationError(
                f"the outline of {mould.name} fits in several directions, and its tethers are not seen "
                "clearly enough to tell which; give --landmark at two tethers",
                close[0],
            )
    return close[0]


def _turn(first: Registration, second: Registration) -> float:
    """Angle between two poses, radians, -pi to pi."""
    between = np.linalg.solve(first.matrix[:2, :2], second.matrix[:2, :2])
    return float(np.arctan2(between[1, 0], between[0, 0]))


def _overlap(registration: Registration, mould: Mould, region: shapely.Polygon) -> float:
    """Intersection over union of the outline and the region found."""
    shape = shapely.transform(mould.outline, registration.to_pixels)
    common = shape.intersection(region).area
    return float(common / (shape.area + region.area - common))


def _require_overlap(found: Registration, least: float, mould: Mould, region: shapely.Polygon) -> None:
    overlap = _overlap(found, mould, region)
    if overlap < least:
        raise RegistrationError(
            f"the region in the image does not have the shape of {mould.name}: they overlap by "
            f"{100 * overlap:.0f} %, at least {100 * least:.0f} % is needed; {ADVICE}",
            found,
        )


def _slopes_across(
    image: NDArray[np.float64], edges: Edges, registration: Registration, reach: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places along the normals (m,), l0, and the image's slope there (n, m), per pixel."""
    step = 0.5 / registration.scale
    count = int(np.ceil(reach / step)) + 1
    along = np.arange(-count, count + 1, dtype=np.float64) * step
    points = edges.points[:, None] + along[:, None] * edges.normals[:, None]
    columns, rows = np.moveaxis(registration.to_pixels(points.reshape(-1, 2)).reshape(points.shape), -1, 0)
    profile = map_coordinates(image, [rows, columns], order=1, mode="nearest")
    return along, np.asarray(np.gradient(profile, 0.5, axis=1), dtype=np.float64)


def _require_one_edge(
    even: NDArray[np.float64], rim: Edges, registration: Registration, mould: Mould
) -> None:
    """Refuse a wall visible as a band: a second edge at a fixed distance along much of the rim."""
    along, slopes = _slopes_across(even, rim, registration, BAND)
    # The rising and falling slopes that a given share of the rim exceeds.
    common = np.abs(np.percentile(slopes, [100 * BAND_PART, 100 * (1 - BAND_PART)], axis=0)).max(axis=0)
    apart = np.abs(along) > max(NEAR, BLURRED / 2 / registration.scale)
    peaks, _ = find_peaks(common, height=SECOND_EDGE * common.max())
    second = along[[peak for peak in peaks if apart[peak]]]
    if len(second):
        raise RegistrationError(
            f"the rim of {mould.name} shows a second edge, {abs(second[0]):.1f} l0 from the first: its wall "
            "is visible as a band, or the tissue follows it closely; give --landmark at posts or corners",
            registration,
        )


def _edge_offsets(
    image: NDArray[np.float64], edges: Edges, registration: Registration, reach: float, least: float
) -> NDArray[np.float64]:
    """How far along its normal each edge point (n,) meets the steepest slope, l0; NaN without one."""
    along, slope = _slopes_across(image, edges, registration, reach)
    slope, step = np.abs(slope), along[1] - along[0]
    top = 1 + slope[:, 1:-1].argmax(axis=1)
    each = np.arange(len(top))
    left, middle, right = (slope[each, top + k] for k in (-1, 0, 1))
    curvature = left - 2 * middle + right
    shift = np.where(curvature < 0, 0.5 * (left - right) / np.where(curvature < 0, curvature, 1.0), 0.0)
    offsets = along[top] + np.clip(shift, -1, 1) * step
    ends = (top == 1) | (top == slope.shape[1] - 2)  # still rising at the end: another edge
    return np.where((middle > least) & ~ends, offsets, np.nan)


def _fit(registration: Registration, edges: Edges, offsets: NDArray[np.float64]) -> Registration:
    """The similarity that moves the edge points onto the edges found, by a robust fit."""
    there = np.isfinite(offsets)
    if there.sum() < 8:
        return registration
    points, normals, wanted = edges.points[there], edges.normals[there], offsets[there]

    def misses(change: NDArray[np.float64]) -> NDArray[np.float64]:
        a, b, dx, dy = change
        moved = np.column_stack(
            [a * points[:, 0] - b * points[:, 1] + dx, b * points[:, 0] + a * points[:, 1] + dy]
        )
        return np.asarray(np.sum(moved * normals, axis=1) - wanted)

    a, b, dx, dy = least_squares(misses, np.zeros(4), loss="cauchy", f_scale=0.1).x
    change = np.array([[1 + a, -b, dx], [b, 1 + a, dy], [0, 0, 1]])
    return Registration(registration.matrix @ change, registration.method, registration.residual)
