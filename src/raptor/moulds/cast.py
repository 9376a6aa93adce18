"""A mould cast with a number of layers and imaged: what follows from its geometry, computed once.

A prediction, an evaluation, a fit or a check makes one `CastMould` and passes it on.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, wraps
from typing import TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.frame import IMAGE_SIZE, pixel_size
from raptor.moulds.geometry import CLEARANCE, FITTED, Mould
from raptor.moulds.loops import centre_of, smallest_loop
from raptor.moulds.raster import MouldImage, mould_image, tether_depth
from raptor.raster import density_image, density_threshold

THIN = 4.0  # l0, 5.5 sigma
Answer = TypeVar("Answer")
HALF_SPAN = int(np.ceil(IMAGE_SIZE / 2))  # l0; no site of the image lies beyond


def once_per_cast(compute: Callable[["CastMould"], Answer]) -> Callable[["CastMould"], Answer]:
    """Keep what a function computes of a cast mould with that mould, as `cached_property` does."""

    @wraps(compute)
    def kept(cast: "CastMould") -> Answer:
        known = cast.__dict__  # a frozen dataclass has one, and allows no other assignment
        name = f"{compute.__module__}.{compute.__name__}"
        if name not in known:
            known[name] = compute(cast)
        found: Answer = known[name]
        return found

    return kept


@dataclass(frozen=True)
class CastMould:
    """A mould, its lattice and both as images, each computed on first use.

    Parameters
    ----------
    mould : Mould
    layers : int
        Of the lattice.
    pixels : int
        Per side of the images.
    """

    mould: Mould
    layers: int
    pixels: int

    @cached_property
    def image(self) -> MouldImage:
        """Masks (y, x) of depression and tethers; raises as `mould_image`."""
        return mould_image(self.mould, self.pixels)

    @property
    def depression(self) -> NDArray[np.bool_]:
        """Pixels (y, x) where cells may lie."""
        return self.image.depression

    @property
    def tethers(self) -> NDArray[np.bool_]:
        """Pixels (y, x) of tethers."""
        return self.image.tethers

    @cached_property
    def sites(self) -> NDArray[np.float64]:
        """Sites (cells, 3), l0, by layer, then y, then x; raises as `planes`."""
        return _stacked(self.planes, self.layers)

    @cached_property
    def planes(self) -> list[NDArray[np.float64]]:
        """Sites (n, 2) of the even and of the odd layers, l0; raises as `cast_sites`."""
        return _planes(self.mould, self.layers)

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return sum(len(plane) * count for plane, count in self._counted)

    @property
    def _counted(self) -> list[tuple[NDArray[np.float64], int]]:
        """Each plane and the number of layers like it."""
        return [(plane, len(range(parity, self.layers, 2))) for parity, plane in enumerate(self.planes)]

    @cached_property
    def density(self) -> NDArray[np.float64]:
        """Density per pixel (y, x) of the tissue as cast, before it contracts."""
        images = [count * density_image(plane, self.pixels) for plane, count in self._counted]
        return np.asarray(sum(images))

    @property
    def relative_density(self) -> NDArray[np.float64]:
        """The same over that far from walls, (y, x)."""
        return self.density / (self.layers * pixel_size(self.pixels) ** 2)

    @property
    def threshold(self) -> float:
        """Density per pixel above which there is tissue."""
        return density_threshold(self.layers, self.pixels)

    @cached_property
    def tether_depths(self) -> NDArray[np.float64]:
        """Depth of pixel centres in each tether (tethers, y, x), l0; -inf far outside."""
        depths = [tether_depth(tether, self.pixels, reach=1.0) for tether in self.mould.tethers]
        return np.array(depths).reshape(-1, self.pixels, self.pixels)

    @cached_property
    def thin_tethers(self) -> NDArray[np.float64]:
        """The same for each thin tether, which counts as tissue if enclosed by tissue (n, y, x)."""
        polygons = [tether.polygon for tether in self.mould.tethers]
        depths = [
            self.tether_depths[shapely.intersects(polygons, part)].max(axis=0)
            for part in thin_parts(self.mould)
        ]
        return np.array(depths).reshape(-1, self.pixels, self.pixels)

    @cached_property
    def loops(self) -> list[list[NDArray[np.intp]]]:
        """The smallest closed path of sites around each tether, in each layer that has one.

        Indices of sites, one lattice step apart (`smallest_loop`).
        """
        starts = np.searchsorted(self.sites[:, 2], (np.arange(self.layers) + 0.25) / np.sqrt(2))
        found = []
        for tether in self.mould.tethers:
            paths = [smallest_loop(plane, centre_of(tether)) for plane in self.planes]
            of_layers = [(start, paths[layer % 2]) for layer, start in enumerate(starts)]
            found.append([start + path for start, path in of_layers if path is not None])
        return found

    @cached_property
    def long_axis(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Centre and half of the long side, each (2,), l0: see `long_axis`."""
        return long_axis(self.mould)

    @cached_property
    def central_section(self) -> shapely.LineString:
        """The line on which w/w0 is measured."""
        return self.sections((0.0,))[0]

    def sections(self, places: Sequence[float]) -> list[shapely.LineString]:
        """Lines parallel to the central section, at positions from -1 to 1 along half of the long side."""
        centre, half = self.long_axis
        return [_across(centre + place * half, half) for place in places]


def thin_parts(mould: Mould) -> list[shapely.Polygon]:
    """Tethers narrower than 4 l0, which count as tissue if enclosed by tissue.

    The density blurs over such a tether, more so in denser tissue, and nobody cuts a thin post out of a
    measured photograph. Overlapping tethers are one. The width is that of the largest inscribed circle.
    """
    joined = shapely.union_all([tether.polygon for tether in mould.tethers])
    return [part for part in shapely.get_parts(joined) if part.buffer(-0.999 * THIN / 2).is_empty]


def cast_sites(mould: Mould, layers: int) -> NDArray[np.float64]:
    """Sites (cells, 3) inside a mould's depression, by at least `CLEARANCE`, l0, by layer, then y, then x.

    Layer k lies at z = (k + 1/2) / sqrt 2; even layers have sites at integer x and y, odd layers at
    half-integer x and y, so that the point set has the full square symmetry about the image centre.

    Raises
    ------
    RaptorError
        If there is none.
    """
    return _stacked(_planes(mould, layers), layers)


def _stacked(planes: Sequence[NDArray[np.float64]], layers: int) -> NDArray[np.float64]:
    """Sites (cells, 3) of all layers."""
    heights = (np.arange(layers) + 0.5) / np.sqrt(2)
    parts = [
        np.column_stack([planes[layer % 2], np.full(len(planes[layer % 2]), height)])
        for layer, height in enumerate(heights)
    ]
    return np.concatenate(parts)


def _planes(mould: Mould, layers: int) -> list[NDArray[np.float64]]:
    """Sites (n, 2) of the even and of the odd layers; raises as `cast_sites`."""
    planes = [_plane(mould, 0.5 * parity) for parity in range(min(layers, 2))]
    if not any(map(len, planes)):
        x0, y0, x1, y1 = mould.outline.bounds
        larger = FITTED / max(x1 - x0, y1 - y0)
        raise RaptorError(
            f"{mould.name} holds no cell: no lattice site lies inside its depression; sites are 1 l0 "
            f"apart, so draw it larger, or give a scale up to {larger:.3g} times as large"
        )
    return planes


def central_section(mould: Mould) -> shapely.LineString:
    """The line across the centre of the outline's minimum rotated rectangle, along its short side.

    If the sides are equal, the one nearer to x is the long one.
    """
    return _across(*long_axis(mould))


def long_axis(mould: Mould) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centre of the outline's minimum rotated rectangle, and half of its long side, each (2,), l0."""
    rectangle = shapely.oriented_envelope(mould.outline)
    corners = shapely.get_coordinates(rectangle)[:4]
    sides = corners[1:3] - corners[:2]
    lengths = np.linalg.norm(sides, axis=1)
    if np.isclose(lengths[0], lengths[1], rtol=1e-6):
        long = int(np.abs(sides[1, 0]) > np.abs(sides[0, 0]))
    else:
        long = int(lengths[1] > lengths[0])
    return corners.mean(axis=0), sides[long] / 2


def _plane(mould: Mould, shift: float) -> NDArray[np.float64]:
    """Sites (n, 2) of one layer, l0, by y, then x."""
    axis = np.arange(-HALF_SPAN, HALF_SPAN + 1) + shift
    points = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    return points[mould.forbidden_depth(points) <= -CLEARANCE]


def _across(middle: NDArray[np.float64], half: NDArray[np.float64]) -> shapely.LineString:
    """The line through a point across an axis, extending one image width to both sides."""
    reach = IMAGE_SIZE * np.array([-half[1], half[0]]) / np.hypot(*half)
    return shapely.LineString([middle - reach, middle + reach])
