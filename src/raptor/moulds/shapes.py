"""Closed shapes and open lines of a drawing, in its own units."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from raptor.frame import IMAGE_SIZE
from raptor.moulds.geometry import Circle, PolygonTether, Tether

ROUND = 1e-3  # of its radius: tolerance for a circle
SAME = 1e-3  # of its area: shapes that differ less are duplicates
ROLES = {"outline": ("outline", "depression"), "tether": ("tether", "post")}


@dataclass(frozen=True)
class Page:
    """The page of a drawing: lower left corner and sides, drawing units, y up."""

    x: float
    y: float
    width: float
    height: float

    @property
    def centre(self) -> tuple[float, float]:
        """Its centre."""
        return self.x + self.width / 2, self.y + self.height / 2

    @property
    def is_frame(self) -> bool:
        """Whether it is a square of 62.5 units: drawn in l0."""
        return bool(np.allclose((self.width, self.height), IMAGE_SIZE, rtol=1e-6))

    def covers(self, shape: shapely.Geometry) -> bool:
        """Whether a shape lies on it."""
        sheet = shapely.box(self.x, self.y, self.x + self.width, self.y + self.height)
        return bool(sheet.buffer(1e-6 * self.width).covers(shape.envelope))


@dataclass(frozen=True)
class Shape:
    """A closed line of a drawing, in its units, y up; `role` is "outline", "tether" or ""."""

    name: str
    polygon: shapely.Polygon
    role: str = ""

    @property
    def size(self) -> float:
        """Area of its convex hull, which a shape that crosses itself has too."""
        return float(self.polygon.convex_hull.area)

    @cached_property
    def tether(self) -> Tether:
        """The shape as a tether; drawn circles stay circles."""
        return circle_of(self.polygon) or PolygonTether(self.polygon)


@dataclass(frozen=True)
class Line:
    """An open line of a drawing: corners (n, 2)."""

    name: str
    corners: NDArray[np.float64]
    role: str = ""


def role_of(*words: str) -> str:
    """The role in a name: "outline", "tether" or ""."""
    for word in words:
        for role, beginnings in ROLES.items():
            if word.strip().lower().startswith(beginnings):
                return role
    return ""


def circle_of(polygon: shapely.Polygon) -> Circle | None:
    """The circle drawn by a polygon of many corners, if any."""
    corners = shapely.get_coordinates(polygon.exterior)
    if len(corners) < 16 or polygon.interiors or not polygon.is_valid:
        return None
    x0, y0, x1, y1 = polygon.bounds
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    reach = np.hypot(corners[:, 0] - x, corners[:, 1] - y)
    radius = float((reach.max() + reach.min()) / 2)
    steps = np.hypot(*np.diff(corners, axis=0).T)
    if np.ptp(reach) > 2 * ROUND * radius or steps.max() > 0.5 * radius:
        return None
    return Circle(x, y, radius)


def are_same(shape: Shape, other: Shape) -> bool:
    """Whether two shapes are duplicates."""
    first, second = shape.polygon, other.polygon
    near = np.abs(np.subtract(first.bounds, second.bounds)).max() <= SAME * np.sqrt(shape.size)
    if not near or not (first.is_valid and second.is_valid):
        return bool(near and first.equals(second))
    return bool(first.symmetric_difference(second).area <= SAME * first.area)
