"""A drawing of a mould in its own units: what SVG, DXF, GeoJSON and pictures have in common.

Closed lines are shapes; open lines count if several of them close a shape together, as in CAD drawings.
"""

from dataclasses import dataclass, replace
from math import ceil, floor, log10
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.frame import IMAGE_SIZE
from raptor.moulds.geometry import (
    FITTED,
    SMALLEST_TETHER,
    Circle,
    Mould,
    PolygonTether,
    Tether,
    require_standing,
)
from raptor.moulds.lines import GAP, joined, require_closed
from raptor.moulds.shapes import Line, Page, Shape, are_same

SMALLEST = 0.5  # l0; an outline whose longest side is shorter holds no cell
ROW = 0.5  # l0; spacing of the rows of sites of all layers, along x and along y
LARGEST_BLUR = 0.125  # l0; no wall is moved farther than this
DIGITS = 4  # decimals of a coordinate in l0; drawing programs and renderers round below that
PAGE = 0.98  # share of the page's sides covered by a background
FARTHEST = 1e9  # drawing units; larger coordinates are mistakes


@dataclass(frozen=True)
class Drawing:
    """Closed shapes and open lines, in drawing units, y up.

    Parameters
    ----------
    shapes : tuple of Shape
    lines : tuple of Line
    page : Page or None
        None if the file does not give the size of its page.
    unit : str
        Name of a drawing unit in messages.
    mm : float or None
        Millimetres per unit, if the file has a real unit.
    l0 : float or None
        l0 per unit, if the file states it.
    framed : bool
        Whether the page is the frame.
    blur : float
        Precision of walls, drawing units. A corner nearer than this to a row of sites is moved onto it, so
        that noise does not decide about a whole row.
    """

    shapes: tuple[Shape, ...]
    lines: tuple[Line, ...] = ()
    page: Page | None = None
    unit: str = "user unit"
    mm: float | None = None
    l0: float | None = None
    framed: bool = False
    blur: float = 0.0

    def mould(self, path: Path, scale: float | None = None, mm_per_l0: float | None = None) -> Mould:
        """The mould drawn in the file `path`, lengths in l0.

        The centre of the outline's bounding box is the origin. Without a scale (l0 per drawing unit, or
        millimetres per l0) the page is the frame if so drawn; otherwise the outline's longest side becomes
        52 l0.

        Raises
        ------
        RaptorError
            If there is no outline or several, or the mould cannot be cast; the message names a scale that
            fits.
        """
        try:
            outline, tethers = _told_apart(self._closed(), self.page)
            placement = self._placement(outline, scale, mm_per_l0)
            blur = min(self.blur * placement.scale, LARGEST_BLUR)
            walls = _placed(PolygonTether(outline.polygon), placement, blur).polygon
            bare = Mould(walls, name=path.stem)  # raises for an invalid outline first
            standing = tuple(_placed(shape.tether, placement, blur) for shape in tethers)
            for shape, tether in zip(tethers, standing, strict=True):
                _require_wide(tether, shape.name, placement, walls)
                require_standing(tether, walls, f"{path.stem}: tether {shape.name}")
            return replace(
                bare, tethers=standing, mm_per_l0=placement.mm_per_l0, note=placement.note(self.unit)
            )
        except RaptorError as error:
            raise RaptorError(f"mould file {path}: {error}") from error

    def _closed(self) -> list[Shape]:
        """The shapes, with those closed by open lines, without duplicates."""
        corners = [shapely.get_coordinates(shape.polygon) for shape in self.shapes]
        corners += [line.corners for line in self.lines]
        everything = np.concatenate(corners) if corners else np.zeros((0, 2))
        if everything.size and not np.abs(everything).max() < FARTHEST:
            raise RaptorError(f"a coordinate is beyond {FARTHEST:g}, or not a number; check its corners")
        closed = list(self.shapes)
        longest = float(np.ptp(everything, axis=0).max()) if everything.size else 0.0
        if self.lines:
            closed += joined(self.lines, GAP * longest)
            require_closed(self.lines, closed, longest)
        kept: list[Shape] = []
        for shape in sorted(closed, key=lambda shape: shape.role == ""):  # of duplicates, one with a role
            if not any(are_same(shape, other) for other in kept):
                kept.append(shape)
        chosen = {id(shape) for shape in kept}
        return [shape for shape in closed if id(shape) in chosen]

    def _placement(self, outline: Shape, scale: float | None, mm_per_l0: float | None) -> "Placement":
        """The position of the origin, and the length of a drawing unit."""
        x0, y0, x1, y1 = outline.polygon.bounds
        width, height = x1 - x0, y1 - y0
        longest, middle = max(width, height), ((x0 + x1) / 2, (y0 + y1) / 2)
        if not longest > 0:
            raise RaptorError("the outline is a point; draw a shape that encloses an area")
        named = "scale"
        if scale is None and mm_per_l0 is not None and self.mm is not None:
            scale, named = self.mm / mm_per_l0, "mm-per-l0"
        if scale is None:
            scale = self.l0
        if scale is None and self.framed and self.page is not None and self.page.covers(outline.polygon):
            framed = IMAGE_SIZE / self.page.width
            if longest * framed >= SMALLEST:
                middle, scale = self.page.centre, framed
        fitted = scale is None
        scale = FITTED / longest if scale is None else scale
        if mm_per_l0 is None and self.mm is not None:
            mm_per_l0 = float(f"{self.mm / scale:.6g}")
        made = Placement(*middle, scale, mm_per_l0, fitted)
        if not SMALLEST <= longest * scale <= IMAGE_SIZE * (1 + 1e-6):
            raise RaptorError(
                f"the outline is {width * scale:.4g} x {height * scale:.4g} l0 at {scale:.4g} l0 per "
                f"{self.unit}, and the frame is {IMAGE_SIZE} l0 wide; {self._advice(named, longest, scale)}"
            )
        return made

    def _advice(self, named: str, longest: float, scale: float) -> str:
        """The scale that fits an outline whose longest side is given in drawing units."""
        small = longest * scale < SMALLEST
        if named == "mm-per-l0" and self.mm is not None:
            fits = f"--mm-per-l0 {rounded(self.mm * longest / FITTED, up=True)}"
            limit = rounded(self.mm * longest / (SMALLEST if small else IMAGE_SIZE), up=not small)
            return f"give --mm-per-l0 of {limit} or {'less' if small else 'more'} ({fits} fits)"
        limit = rounded((SMALLEST if small else IMAGE_SIZE) / longest, up=small)
        side = "more" if small else "less"
        return f"give a scale of {limit} or {side} (--scale {rounded(FITTED / longest)} fits)"


@dataclass(frozen=True)
class Placement:
    """The point (x, y) of a drawing that is the frame's origin, and l0 per drawing unit."""

    x: float
    y: float
    scale: float
    mm_per_l0: float | None
    fitted: bool

    def note(self, unit: str) -> str:
        """Description of how the drawing was scaled."""
        said = f"{self.scale:.4g} l0 per {unit}"
        return f"fitted to the frame at {said} (overrule by --scale)" if self.fitted else said


def rounded(value: float, up: bool = False) -> str:
    """A positive number rounded down to three digits, or up with `up`."""
    step = 10.0 ** (floor(log10(value)) - 2)
    return f"{(ceil if up else floor)(value / step * (1 + (-1e-9 if up else 1e-9))) * step:.3g}"


def _told_apart(shapes: list[Shape], page: Page | None) -> tuple[Shape, list[Shape]]:
    """The outline, and all other shapes as tethers."""
    outlines = [shape for shape in shapes if shape.role == "outline"]
    if len(outlines) > 1:
        names = ", ".join(shape.name for shape in outlines)
        raise RaptorError(
            f"{len(outlines)} shapes are called outline ({names}); a mould is one connected outline, so keep "
            "one and name the shapes in it tether"
        )
    candidates = outlines or [shape for shape in shapes if shape.role != "tether"]
    if not candidates:
        raise RaptorError("it draws no outline; draw the depression as a closed shape and call it 'outline'")
    outline = max(candidates, key=lambda shape: shape.size)
    others = [shape for shape in shapes if shape is not outline]
    if outlines:
        return outline, [shape for shape in others if not _is_background(shape, outline, page)]
    _require_no_background(outline, others, page)
    return outline, others


def _covers_page(shape: Shape, page: Page | None) -> bool:
    if page is None:
        return False
    sheet = shapely.box(page.x, page.y, page.x + page.width, page.y + page.height)
    return bool(shape.polygon.envelope.intersection(sheet).area >= PAGE**2 * sheet.area)


def _is_background(shape: Shape, outline: Shape, page: Page | None) -> bool:
    """Whether a shape without a role is the background of the outline."""
    return not shape.role and _covers_page(shape, page) and bool(shape.polygon.covers(outline.polygon))


def _require_no_background(outline: Shape, others: list[Shape], page: Page | None) -> None:
    """Raise a RaptorError if the outline seems to be the background of the mould."""
    if not others or not _covers_page(outline, page):
        return
    second = max(others, key=lambda shape: shape.size)
    holds = all(second.polygon.envelope.covers(shape.polygon) for shape in others)
    if holds and (len(others) > 1 or second.size > 0.05 * outline.size):
        raise RaptorError(
            f"its largest shape, {outline.name}, is as large as the page and looks like a background; delete "
            f"it, or call the depression 'outline' (is it {second.name}?)"
        )


def _placed(shape: Tether, placement: Placement, blur: float) -> Tether:
    """A shape in l0, rounded to the significant digits."""
    moved = _on_rows(shape.shifted(-placement.x, -placement.y).scaled(placement.scale), blur)
    if isinstance(moved, Circle):
        return Circle(*(round(value, DIGITS) for value in (moved.x, moved.y, moved.radius)))
    return PolygonTether(shapely.transform(moved.polygon, lambda corners: np.round(corners, DIGITS) + 0.0))


def _require_wide(tether: Tether, name: str, placement: Placement, outline: shapely.Polygon) -> None:
    """Raise a RaptorError for a tether that is too thin, naming a scale at which it is not."""
    if not tether.polygon.is_valid or tether.polygon.is_empty:
        return  # reported elsewhere
    half = float(shapely.maximum_inscribed_circle(tether.polygon).length)
    if half >= 0.999 * SMALLEST_TETHER or half == 0:
        return
    x0, y0, x1, y1 = outline.bounds
    grown = SMALLEST_TETHER / half
    needed = f"--scale {rounded(placement.scale * grown, up=True)} or more"
    fits = max(x1 - x0, y1 - y0) * grown <= IMAGE_SIZE
    advice = f"give {needed}" if fits else "draw it wider (no scale that fits the frame makes it so)"
    raise RaptorError(
        f"tether {name} is too thin to hold cells back: {2 * half:.2g} l0 across at "
        f"{placement.scale:.4g} l0 per unit, {2 * SMALLEST_TETHER} are needed; {advice}"
    )


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
