"""Random moulds with and without symmetry (paper, "Training Data"; Andrews et al. 2023).

An outline is a closed curve around the origin, r(angle), either a polygon through random corners or a smooth
Fourier series. It is given a random symmetry, scaled to a random number of cells, and filled with small round
tethers placed with the same symmetry. Moulds that cannot be cast well (a piece cut off, a neck too narrow, an
outline outside the image) are rejected.
"""

import numpy as np
import shapely
from numpy.random import Generator
from numpy.typing import NDArray
from pydantic import Field, model_validator

from raptor.core.blocks import Block, Positive
from raptor.core.errors import RaptorError
from raptor.frame import IMAGE_SIZE
from raptor.moulds.geometry import Circle, Mould
from raptor.symmetry import Element

SMOOTH_CORNERS = 96  # corners of a smooth outline
MAX_ASPECT = 2.6
ATTEMPTS = 2000
TETHER_RADIUS = (0.8, 1.5)  # l0, equal within a mould; experimental posts are thin compared with the tissue
ARM_WIDTH = 4.0  # l0, narrowest neck and gap between tethers: a few cells, so that tissue can pass
MARGIN = 3.0  # l0, free border of the image: more than 3 sigma of the raster
SYMMETRY = {"none": 0.18, "mirror": 0.30, "half_turn": 0.22, "mirrors": 0.24, "square": 0.06}
"""Share of each symmetry class: 4.06 distinct images per mould under D4 (the paper: 4.05)."""

_MIRROR_Y = Element(quarter_turns=2, mirror=True)  # y -> -y
_MIRROR_X = Element(quarter_turns=0, mirror=True)  # x -> -x
_HALF_TURN = Element(quarter_turns=2, mirror=False)
GROUPS: dict[str, tuple[Element, ...]] = {
    "none": (Element(0, False),),
    "mirror": (Element(0, False), _MIRROR_Y),
    "half_turn": (Element(0, False), _HALF_TURN),
    "mirrors": (Element(0, False), _MIRROR_X, _MIRROR_Y, _HALF_TURN),
    "square": Element.all(),
}
"""The elements of D4 that leave a mould of each symmetry class unchanged."""


class RandomMoulds(Block):
    """The distribution of random moulds."""

    cells: tuple[Positive, Positive] = Field((3000, 6000), description="bounds of the number of cells")
    tethers: tuple[int, int] = Field((2, 16), description="bounds of the number of tethers")

    @model_validator(mode="after")
    def _ascending(self) -> "RandomMoulds":
        for name, least in (("cells", 1), ("tethers", 0)):
            low, high = getattr(self, name)
            if not least <= low <= high:
                raise ValueError(f"{name} is [{low}, {high}]; an ascending range from {least} is needed")
        return self

    def draw(self, rng: Generator, layers: int, name: str, symmetry: str | None = None) -> Mould:
        """Draw one mould; the same generator state gives the same mould.

        Parameters
        ----------
        layers : int
            Cell layers, which relate the number of cells to the area.
        symmetry : str, optional
            A key of `GROUPS`; drawn from `SYMMETRY` if not given.

        Raises
        ------
        RaptorError
            If no mould that meets all bounds was found in many attempts.
        """
        drawn = str(rng.choice(list(SYMMETRY), p=list(SYMMETRY.values())))
        for _ in range(ATTEMPTS):
            mould = self._attempt(rng, symmetry or drawn, layers, name)
            if mould is not None:
                turned = Element(int(rng.integers(2)), mirror=False)  # a mirror may have either axis
                return mould.transformed(turned.matrix)
        raise RaptorError(
            f"no mould with {self.cells[0]} to {self.cells[1]} cells in {layers} layers, "
            f"{self.tethers[0]} to {self.tethers[1]} tethers and arms of {ARM_WIDTH} l0 was "
            f"found in {ATTEMPTS} attempts; widen the bounds under 'random_moulds'"
        )

    def _attempt(self, rng: Generator, symmetry: str, layers: int, name: str) -> Mould | None:
        outline = _random_outline(rng, symmetry)
        radius = rng.uniform(*TETHER_RADIUS)
        count = int(rng.integers(self.tethers[0], self.tethers[1] + 1))
        # Cells per area of one layer is 1 / l0^2.
        area = rng.uniform(*self.cells) / layers + count * np.pi * radius**2
        outline = _scaled(outline, np.sqrt(area / outline.area))
        if max(map(abs, outline.bounds)) > IMAGE_SIZE / 2 - MARGIN:
            return None
        if not _wide_enough(outline, ARM_WIDTH):
            return None
        tethers = self._place_tethers(rng, outline, symmetry, count, radius)
        if tethers is None:
            return None
        mould = Mould(outline, tethers, symmetry, name)
        cells = layers * mould.depression.area  # close to the count of sites
        if not self.cells[0] * 1.02 <= cells <= self.cells[1] * 0.98:
            return None
        if mould.depression.buffer(-ARM_WIDTH / 3).geom_type != "Polygon":
            return None  # tethers cut it in pieces
        return mould

    def _place_tethers(
        self, rng: Generator, outline: shapely.Polygon, symmetry: str, count: int, radius: float
    ) -> tuple[Circle, ...] | None:
        """Place about `count` tethers, with their images, at least an arm apart; None if crowded."""
        room = outline.buffer(-(radius + ARM_WIDTH / 2))
        rim = room.difference(outline.buffer(-(radius + 2.5 * ARM_WIDTH)))
        if room.is_empty or count == 0:
            return () if count == 0 else None
        placed: list[Circle] = []
        for _ in range(200):
            if len(placed) >= count:
                break
            # Most posts stand near the rim, where they hold the tissue; some stand anywhere.
            region = rim if rng.random() < 0.7 and not rim.is_empty else room
            orbit = _orbit(_random_point(rng, region), symmetry, radius)
            if len(placed) + len(orbit) > self.tethers[1]:
                continue
            if not all(shapely.contains_xy(room, post.x, post.y) for post in orbit):
                continue  # moved outside when placed on an axis
            if _apart(placed + orbit, 2 * radius + ARM_WIDTH):
                placed += orbit
        return tuple(placed) if self.tethers[0] <= len(placed) <= self.tethers[1] else None


def _random_outline(rng: Generator, symmetry: str) -> shapely.Polygon:
    """A random outline of unit size with the given symmetry, exact to the last bit."""
    group = GROUPS[symmetry]
    sector = 2 * np.pi / len(group)
    roughness = rng.uniform(0.0, 0.45)
    if rng.random() < 0.5:
        corners = int(rng.integers(1 if len(group) > 2 else 3, max(3, 14 // len(group)) + 1))
        angles = np.sort(rng.uniform(0.02, 0.98, corners)) * sector
        radii = 1 + roughness * rng.uniform(-1, 1, corners)
    else:
        angles = (np.arange(SMOOTH_CORNERS // len(group)) + 0.5) * sector * len(group) / SMOOTH_CORNERS
        radii = 1 + roughness * _fourier(rng, angles, symmetry)
    points = np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])
    points = _images(points, group)
    if symmetry != "square":
        stretch = rng.uniform(1.0, MAX_ASPECT) ** 0.5
        points = points * np.array([stretch, 1 / stretch])
    order = np.argsort(np.arctan2(points[:, 1], points[:, 0]))
    polygon = shapely.Polygon(points[order])
    if rng.random() < 0.3:
        polygon = polygon.convex_hull
    return polygon if polygon.is_valid and polygon.area > 0 else shapely.box(-1, -0.5, 1, 0.5)


def _fourier(rng: Generator, angles: NDArray[np.float64], symmetry: str) -> NDArray[np.float64]:
    """A smooth random function of the angle, of size about 1, with the symmetry's harmonics."""
    step = {"none": 1, "mirror": 1, "half_turn": 2, "mirrors": 2, "square": 4}[symmetry]
    harmonics = np.arange(step, 9, step)
    amplitude = rng.normal(size=(2, len(harmonics))) / np.sqrt(harmonics)
    if symmetry not in ("none", "half_turn"):
        amplitude[1] = 0.0  # odd under the mirror
    phase = harmonics[:, None] * angles
    values = amplitude[0] @ np.cos(phase) + amplitude[1] @ np.sin(phase)
    return np.asarray(np.clip(values, -1.5, 1.5) / 1.5)


def _images(points: NDArray[np.float64], group: tuple[Element, ...]) -> NDArray[np.float64]:
    return np.concatenate([points @ element.matrix.T for element in group])


def _orbit(point: NDArray[np.float64], symmetry: str, radius: float) -> list[Circle]:
    """The post and its images; on an axis if the images would overlap."""
    x, y = point
    if symmetry != "none":
        x, y = (0.0 if abs(c) < radius * 1.5 else c for c in point)
    if symmetry == "square" and abs(abs(x) - abs(y)) < radius * 1.5:
        y = np.copysign(x, y)
    group = GROUPS[symmetry]
    images = _images(np.array([[x, y]]), group)
    unique = {(float(px) + 0.0, float(py) + 0.0) for px, py in images}
    return [Circle(px, py, radius) for px, py in sorted(unique)]


def _apart(circles: list[Circle], distance: float) -> bool:
    centres = np.array([(c.x, c.y) for c in circles])
    gaps = np.linalg.norm(centres[:, None] - centres[None], axis=-1)
    return bool((gaps[np.triu_indices(len(circles), 1)] >= distance).all())


def _random_point(rng: Generator, region: shapely.Geometry) -> NDArray[np.float64]:
    x0, y0, x1, y1 = region.bounds
    for _ in range(1000):
        point = rng.uniform((x0, y0), (x1, y1))
        if shapely.contains_xy(region, *point):
            return point
    return np.array(region.representative_point().coords[0])


def _wide_enough(outline: shapely.Polygon, width: float) -> bool:
    """Whether the outline stays connected and keeps nearly all its area when thin arms are removed."""
    core = outline.buffer(-width / 2)
    if core.is_empty or core.geom_type != "Polygon":
        return False
    return bool(core.buffer(width / 2).area > 0.96 * outline.area)


def _scaled(polygon: shapely.Polygon, factor: float) -> shapely.Polygon:
    return shapely.transform(polygon, lambda xy: xy * factor)
