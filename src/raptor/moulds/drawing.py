"""A drawing of a mould in its own units: what SVG and PNG files have in common."""

from dataclasses import dataclass
from math import floor, log10
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.frame import IMAGE_SIZE
from raptor.moulds.geometry import Circle, Mould, PolygonTether, Tether, require_standing

ROW = 0.5  # l0; rows of sites of all layers, along x and along y
LARGEST_BLUR = 0.125  # l0; no wall is moved farther than this


@dataclass(frozen=True)
class Page:
    """The square that represents the frame of 62.5 l0: centre and side, drawing units, y up."""

    x: float
    y: float
    side: float


@dataclass(frozen=True)
class Drawing:
    """An outline and tethers, in drawing units, y up.

    Parameters
    ----------
    outline : shapely.Polygon
        The depression, tethers not cut out.
    tethers : tuple of (str, Tether)
        Each with its name in messages.
    page : Page or None
        None if the file does not give the size of its page.
    unit : str
        Name of a drawing unit in messages.
    blur : float
        How finely the drawing tells where a wall is, drawing units. A corner nearer than this to a row of
        sites is put on it: sites on a wall hold no cell, and noise must not decide about a whole row.
    """

    outline: shapely.Polygon
    tethers: tuple[tuple[str, Tether], ...]
    page: Page | None
    unit: str
    blur: float = 0.0

    def mould(self, path: Path, scale: float | None) -> Mould:
        """The mould drawn in the file `path`, lengths in l0.

        With a scale (l0 per drawing unit) the centre of the outline's bounding box is the origin; without
        one the page is the frame.

        Raises
        ------
        RaptorError
            If the mould cannot be cast, or neither a scale nor a page gives its size.
        """
        try:
            x, y, unit = self._placement(scale)
            blur = min(self.blur * unit, LARGEST_BLUR)

            def placed(shape: Tether) -> Tether:
                return _on_rows(shape.shifted(-x, -y).scaled(unit), blur)

            outline = placed(PolygonTether(self.outline)).polygon
            Mould(
                outline, name=path.stem
            )  # raises for an invalid outline before tethers are compared with it
            tethers = tuple(placed(tether) for _, tether in self.tethers)
            for (called, _), tether in zip(self.tethers, tethers, strict=True):
                require_standing(tether, outline, f"{path.stem}: {called}")
            return Mould(outline, tethers, name=path.stem)
        except RaptorError as error:
            raise RaptorError(f"mould file {path}: {error}") from error

    def _placement(self, scale: float | None) -> tuple[float, float, float]:
        """The origin (x, y) in drawing units, and l0 per drawing unit."""
        if scale is None and self.page is not None:
            return self.page.x, self.page.y, IMAGE_SIZE / self.page.side
        if scale is None:
            raise RaptorError(
                f"it does not say how long a {self.unit} is; give --scale, in l0 per {self.unit}, or the "
                "attribute data-l0 or viewBox"
            )
        x0, y0, x1, y1 = self.outline.bounds
        width, height = (x1 - x0) * scale, (y1 - y0) * scale
        if max(width, height) > IMAGE_SIZE * (1 + 1e-9):
            largest = _rounded_down(scale * IMAGE_SIZE / max(width, height))
            raise RaptorError(
                f"the outline is {width:.4g} x {height:.4g} l0 at {scale:.4g} l0 per {self.unit}, and the "
                f"frame is {IMAGE_SIZE} l0 wide; give a scale of {largest} or less"
            )
        return (x0 + x1) / 2, (y0 + y1) / 2, scale


def _on_rows(shape: Tether, blur: float) -> Tether:
    """A shape whose corners within `blur` of a row of sites, l0, are moved onto it."""
    if blur == 0 or isinstance(shape, Circle):
        return shape

    def snapped(corners: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = np.rint(corners / ROW) * ROW
        return np.where(np.abs(corners - rows) <= blur, rows, corners)

    # Bevelled corners of the picture become corners again.
    moved = shapely.transform(shape.polygon, snapped).simplify(0.0)
    return PolygonTether(moved) if moved.is_valid and moved.area > 0 else shape


def _rounded_down(value: float) -> str:
    """A positive number rounded down to three digits."""
    step = 10.0 ** (floor(log10(value)) - 2)
    return f"{floor(value / step) * step:.3g}"
