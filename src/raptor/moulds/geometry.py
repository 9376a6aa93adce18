"""A mould: the outline of its depression and the tethers that stand in it. Lengths in l0."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import pi
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.affinity import translate
from shapely.validation import explain_validity

from raptor.core.errors import RaptorError
from raptor.frame import IMAGE_SIZE

FITTED = 52.0  # l0; longest side of a drawing without a scale: the library's median
SMALLEST_TETHER = 0.4  # l0; the half width at which no step or trial move can cross a wall
CLEARANCE = 0.248  # l0; least distance of cells from walls: a quarter, less the rounding of drawings
STRICTLY = 1e-9  # l0; a pixel centre this close to a wall lies on it
TOUCHING = 1e-3  # l0; tolerance for tethers that reach out of the outline
TOO_THIN = f"is too thin to hold cells back; make it at least {2 * SMALLEST_TETHER} l0 across"
CIRCLE_SEGMENTS = 64  # a quarter circle, where a circle must be drawn as a polygon


@dataclass(frozen=True)
class Circle:
    """A round post: centre and radius in l0."""

    x: float
    y: float
    radius: float

    @cached_property
    def polygon(self) -> shapely.Polygon:
        """The post as a polygon, for drawing and for relations between shapes."""
        return shapely.Point(self.x, self.y).buffer(self.radius, quad_segs=CIRCLE_SEGMENTS)

    @property
    def area(self) -> float:
        """Area of the post, l0^2."""
        return pi * self.radius**2

    def validate(self, what: str) -> None:
        """Raise a RaptorError that names the post as `what`, unless it holds cells back."""
        if not self.radius > 0:
            raise RaptorError(f"{what} has radius {self.radius}; it must be positive")
        if self.radius < 0.999 * SMALLEST_TETHER:
            raise RaptorError(f"{what} {TOO_THIN}")

    def stands_in(self, outline: shapely.Polygon) -> bool:
        """Whether it lies in the outline; touching is allowed."""
        centre = shapely.Point(self.x, self.y)
        reach: float = outline.exterior.distance(centre)
        return bool(outline.contains(centre) and reach >= self.radius - TOUCHING)

    def depth(self, points: NDArray[np.float64], marks: Any = None) -> NDArray[np.float64]:
        """Signed depth of points (n, 2) inside the post, (n,), l0; negative outside."""
        return self.radius - np.hypot(points[:, 0] - self.x, points[:, 1] - self.y)

    def transformed(self, matrix: NDArray[np.float64]) -> "Circle":
        """The post moved by a 2 x 2 orthogonal matrix."""
        x, y = matrix @ (self.x, self.y)
        return replace(self, x=float(x), y=float(y))

    def scaled(self, factor: float) -> "Circle":
        """The post scaled about the origin."""
        return Circle(self.x * factor, self.y * factor, self.radius * factor)

    def shifted(self, x: float, y: float) -> "Circle":
        """The post moved by (x, y), l0."""
        return replace(self, x=self.x + x, y=self.y + y)

    def as_json(self) -> dict[str, Any]:
        """As stored in a mould file."""
        return {"x": self.x, "y": self.y, "radius": self.radius}


@dataclass(frozen=True)
class PolygonTether:
    """A tether with any simple outline, such as a bar."""

    polygon: shapely.Polygon

    @property
    def area(self) -> float:
        """Area of the tether, l0^2."""
        return float(self.polygon.area)

    def validate(self, what: str) -> None:
        """Raise a RaptorError that names the tether as `what`, unless it is simple and holds cells back."""
        _validate_polygon(self.polygon, what)
        if self.polygon.buffer(-0.999 * SMALLEST_TETHER).is_empty:
            raise RaptorError(f"{what} {TOO_THIN}")

    def stands_in(self, outline: shapely.Polygon) -> bool:
        """Whether it lies in the outline; touching is allowed."""
        return bool(outline.covers(self.polygon.buffer(-TOUCHING)))

    def depth(self, points: NDArray[np.float64], marks: Any = None) -> NDArray[np.float64]:
        """Signed depth of points (n, 2) inside the tether, (n,), l0; negative outside."""
        return signed_depth(self.polygon, points, marks)

    def transformed(self, matrix: NDArray[np.float64]) -> "PolygonTether":
        """The tether moved by a 2 x 2 orthogonal matrix."""
        return PolygonTether(_transform(self.polygon, matrix))

    def scaled(self, factor: float) -> "PolygonTether":
        """The tether scaled about the origin."""
        return PolygonTether(_transform(self.polygon, np.eye(2) * factor))

    def shifted(self, x: float, y: float) -> "PolygonTether":
        """The tether moved by (x, y), l0."""
        return PolygonTether(translate(self.polygon, x, y))

    def as_json(self) -> dict[str, Any]:
        """As stored in a mould file."""
        return {"polygon": _ring(self.polygon)}


Tether = Circle | PolygonTether


@dataclass(frozen=True, init=False)
class Mould:
    """A depression and its tethers, lengths in l0, the origin at the centre of the image of 62.5 l0.

    Parameters
    ----------
    outline : shapely.Polygon
        The depression. Its holes, if any, become tethers.
    tethers : sequence of Circle, PolygonTether or shapely.Polygon
        Obstacles without cells; stored as a tuple of Circle and PolygonTether.
    symmetry : str
        The class drawn by the generator, a key of `random_moulds.GROUPS`, or "unknown".
    name : str
        Mould id or file name, for messages.
    mm_per_l0 : float or None
        Millimetres per l0, if the mould was drawn in a real unit.
    family : str
        Its family of outlines (`families`), if any.
    note : str
        Description of how a drawing was scaled.

    Raises
    ------
    RaptorError
        If the outline or a tether cannot be cast: see `validate`.

    Examples
    --------
    >>> square = shapely.box(-12, -12, 12, 12)
    >>> mould = Mould(square, tethers=[Circle(0, 5, 1), shapely.box(-8, -8, 8, -6)])
    """

    outline: shapely.Polygon
    tethers: tuple[Tether, ...]
    symmetry: str
    name: str = field(compare=False)
    mm_per_l0: float | None = field(compare=False)
    note: str = field(compare=False)
    family: str = field(compare=False)

    def __init__(
        self,
        outline: shapely.Polygon,
        tethers: Iterable[Tether | shapely.Polygon] = (),
        symmetry: str = "unknown",
        name: str = "mould",
        mm_per_l0: float | None = None,
        note: str = "",
        family: str = "",
    ) -> None:
        if not isinstance(outline, shapely.Polygon):
            raise RaptorError(
                f"{name}: the outline is of type {type(outline).__name__}; give one shapely Polygon, in l0"
            )
        solid = shapely.Polygon(outline.exterior) if outline.interiors else outline
        holes = map(shapely.Polygon, outline.interiors)
        standing = tuple(_tether(each, name) for each in (*tethers, *holes))
        # Attributes of a frozen dataclass cannot be assigned directly.
        vars(self).update(outline=solid, tethers=standing, symmetry=symmetry, name=name)
        vars(self).update(mm_per_l0=mm_per_l0, note=note, family=family)
        self.validate()

    def validate(self) -> None:
        """Raise a RaptorError that names a fault of the mould, if there is one."""
        _validate_polygon(self.outline, f"{self.name}: the outline")
        half = IMAGE_SIZE / 2
        if max(map(abs, self.outline.bounds)) > half:
            raise RaptorError(
                f"{self.name}: the outline reaches {max(map(abs, self.outline.bounds)):g} l0 from "
                f"the origin, outside the image; keep it within {half} l0 in x and y"
            )
        for number, tether in enumerate(self.tethers, start=1):
            require_standing(tether, self.outline, f"{self.name}: tether {number}")
        # The union of tethers is expensive, and most moulds have room even without overlaps.
        room = self.outline.area - sum(tether.area for tether in self.tethers)
        if room < 1e-6 and self.depression.area < 1e-6:
            raise RaptorError(f"{self.name}: the tethers cover the depression; nothing is left to cast")

    def in_millimetres(self, layers: int | None = None) -> str:
        """Its size in millimetres and the depth of the layers; "" if it has no real unit."""
        if self.mm_per_l0 is None:
            return ""
        x0, y0, x1, y1 = (value * self.mm_per_l0 for value in self.outline.bounds)
        deep = "" if layers is None else f", {layers} layers are {depth(layers) * self.mm_per_l0:.3g} mm deep"
        return f"1 l0 is {self.mm_per_l0:.4g} mm: {x1 - x0:.4g} x {y1 - y0:.4g} mm{deep}"

    @cached_property
    def depression(self) -> shapely.Geometry:
        """The region that holds cells: the outline minus the tethers."""
        if not self.tethers:
            return self.outline
        return self.outline.difference(shapely.union_all([t.polygon for t in self.tethers]))

    def forbidden_depth(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Depth of points (n, 2) in a tether or outside the outline, (n,), l0.

        Negative where a cell may lie: minus the distance to the nearest wall.
        """
        marks = shapely.points(points)  # made once, because it costs more than the distances
        depth = -signed_depth(self.outline, points, marks)
        for tether in self.tethers:
            np.maximum(depth, tether.depth(points, marks), out=depth)
        return depth

    def transformed(self, matrix: NDArray[np.float64]) -> "Mould":
        """The mould moved by a 2 x 2 orthogonal matrix."""
        tethers = tuple(tether.transformed(matrix) for tether in self.tethers)
        return replace(self, outline=_transform(self.outline, matrix), tethers=tethers)

    def scaled(self, factor: float) -> "Mould":
        """The mould and its tethers scaled about the origin."""
        outline = _transform(self.outline, np.eye(2) * factor)
        tethers = tuple(tether.scaled(factor) for tether in self.tethers)
        mm_per_l0 = None if self.mm_per_l0 is None else self.mm_per_l0 / factor
        return replace(self, outline=outline, tethers=tethers, mm_per_l0=mm_per_l0)

    def as_feature(self) -> dict[str, Any]:
        """The mould as a GeoJSON feature."""
        properties: dict[str, Any] = {
            "mould": self.name,
            "tethers": [tether.as_json() for tether in self.tethers],
            "symmetry": self.symmetry,
            "area": self.depression.area,
        }
        if self.mm_per_l0 is not None:
            properties["mm_per_l0"] = self.mm_per_l0
        if self.family:
            properties["family"] = self.family
        geometry = {"type": "Polygon", "coordinates": [_ring(self.outline)]}
        return {"type": "Feature", "geometry": geometry, "properties": properties}


def _tether(shape: Any, name: str) -> Tether:
    """A tether in the form stored in a mould."""
    if isinstance(shape, shapely.Polygon):
        return PolygonTether(shape)
    if not isinstance(shape, Tether):
        raise RaptorError(
            f"{name}: a tether is of type {type(shape).__name__}; give a Circle or a shapely Polygon"
        )
    return shape


def depth(layers: int) -> float:
    """Fill height of a number of layers, l0."""
    return float(layers / np.sqrt(2))


def require_standing(tether: Tether, outline: shapely.Polygon, what: str) -> None:
    """Raise a RaptorError that names the tether as `what`, unless it fits a valid outline."""
    tether.validate(what)
    if not tether.stands_in(outline):
        raise RaptorError(f"{what} reaches out of the depression; move it inside the outline")


def signed_depth(
    polygon: shapely.Polygon, points: NDArray[np.float64], marks: Any = None
) -> NDArray[np.float64]:
    """Distance of points (n, 2) to a polygon's boundary, (n,), positive inside, l0.

    `marks` are the points as shapely objects, if already made.
    """
    shapely.prepare(polygon)
    inside = shapely.contains_xy(polygon, points[:, 0], points[:, 1])
    boundary = polygon.exterior
    shapely.prepare(boundary)
    distance = shapely.distance(shapely.points(points) if marks is None else marks, boundary)
    return np.asarray(np.where(inside, distance, -distance), dtype=np.float64)


def _validate_polygon(polygon: shapely.Polygon, what: str) -> None:
    corners = np.unique(shapely.get_coordinates(polygon), axis=0)
    if polygon.is_empty or len(corners) < 3 or polygon.convex_hull.area == 0:
        raise RaptorError(f"{what} is empty; give at least three corners that enclose an area")
    if not polygon.is_valid:
        raise RaptorError(
            f"{what} is not a simple polygon ({explain_validity(polygon)}); draw it so that no edges cross"
        )
    if polygon.interiors:
        raise RaptorError(f"{what} has a hole; fill it: cells are never cast inside a tether")


def _transform(polygon: shapely.Polygon, matrix: NDArray[np.float64]) -> shapely.Polygon:
    return shapely.transform(polygon, lambda xy: xy @ matrix.T)


def _ring(polygon: shapely.Polygon) -> list[list[float]]:
    return [[float(x), float(y)] for x, y in polygon.exterior.coords]
