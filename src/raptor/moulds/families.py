"""Moulds as people make them: families of outlines with layouts of tethers.

A mould is an outline of a family (`outlines`), at a drawn size, with a layout of tethers
(`tether_layouts`), rotated and shifted in the frame. Moulds that cannot be cast well are rejected.
"""

from dataclasses import replace

import numpy as np
import shapely
from numpy.random import Generator
from pydantic import Field, model_validator
from shapely.affinity import rotate, translate

from raptor.core.blocks import Block, Positive, Weight
from raptor.core.errors import RaptorError
from raptor.frame import IMAGE_SIZE
from raptor.moulds.geometry import SMALLEST_TETHER, Circle, Mould, PolygonTether, Tether
from raptor.moulds.outlines import OUTLINES, irregular
from raptor.moulds.summary import symmetry_class
from raptor.moulds.tether_layouts import LAYOUTS

ATTEMPTS = 400
NARROWEST = 2.5  # l0; the narrowest neck of an outline
GAP = 1.5  # l0; least gap between two tethers
MARGIN = 2.2  # l0; rim of the image that stays free, 3 sigma: the library's long moulds need it


class MouldFamilies(Block):
    """The distribution of moulds as people make them; lengths in l0."""

    cells: tuple[Positive, Positive] = Field((1500, 14000), description="bounds of the number of cells")
    families: dict[str, Weight] = Field(
        {
            name: 2.0 if name in ("rectangle", "rounded_rectangle", "dog_bone", "i_shape") else 1.0
            for name in OUTLINES
        },
        description="weight of each family of outlines",
    )
    layouts: dict[str, Weight] = Field(
        {
            name: {"corners": 3.0, "ends": 3.0, "end_bars": 3.0, "none": 0.4}.get(name, 1.0)
            for name in LAYOUTS
        },
        description="weight of each layout of tethers",
    )

    @model_validator(mode="after")
    def _consistent(self) -> "MouldFamilies":
        for key, known in (("families", OUTLINES), ("layouts", LAYOUTS)):
            weights = getattr(self, key)
            strange = sorted(set(weights) - set(known))
            if strange:
                raise ValueError(f"{key} has '{strange[0]}'; known are {', '.join(known)}")
            if not any(weights.values()):
                raise ValueError(f"{key} gives every one weight 0; give at least one a positive weight")
        if self.cells[0] > self.cells[1]:
            raise ValueError(f"cells is {list(self.cells)}; an ascending range is needed")
        return self

    def draw(self, rng: Generator, layers: int, name: str) -> Mould:
        """Draw one mould; the same generator state gives the same mould.

        Parameters
        ----------
        layers : int
            Cell layers, which turn a number of cells into an area.

        Raises
        ------
        RaptorError
            If many attempts found no mould that meets all bounds.
        """
        family = _weighted(rng, self.families)
        for _ in range(ATTEMPTS):
            layout = "holes" if family == "ring" else _weighted(rng, self.layouts)
            mould = self._attempt(rng, family, layout, layers)
            if mould is not None:
                return replace(mould, symmetry=symmetry_class(mould), name=name, family=family)
        raise RaptorError(
            f"no mould of the family {family} with {self.cells[0]} to {self.cells[1]} cells in {layers} "
            f"layers was found in {ATTEMPTS} attempts; widen the bounds under 'mould_families'"
        )

    def _attempt(self, rng: Generator, family: str, layout: str, layers: int) -> Mould | None:
        outline = OUTLINES[family](rng)
        if rng.random() < 0.25:
            outline = irregular(rng, outline, rng.uniform(0.01, 0.05))
        area = rng.uniform(*self.cells) / layers
        factor = np.sqrt(area / outline.area)
        reach = IMAGE_SIZE / 2 - MARGIN
        x0, y0, x1, y1 = (factor * bound for bound in outline.bounds)
        if max(x1 - x0, y1 - y0) > 2 * reach:
            # As large as the frame allows: long moulds fill it.
            factor *= 2 * reach / max(x1 - x0, y1 - y0) * rng.uniform(0.8, 1.0)
        outline = shapely.transform(outline, lambda xy: factor * xy)
        if not _wide_enough(outline):
            return None
        tethers = _standing(LAYOUTS[layout](rng, outline), outline)
        if not tethers and layout != "none":
            return None
        placed = _placed(rng, outline, tethers, reach)
        if placed is None:
            return None
        mould = Mould(*placed)
        cells = layers * mould.depression.area
        if not (self.cells[0] <= cells <= self.cells[1]) or mould.depression.geom_type != "Polygon":
            return None
        return mould


def _weighted(rng: Generator, weights: dict[str, float]) -> str:
    """A key drawn by weight, independent of the order of the keys."""
    names = sorted(weights)
    chances = np.array([weights[name] for name in names])
    return str(rng.choice(names, p=chances / chances.sum()))


def _wide_enough(outline: shapely.Polygon) -> bool:
    """Whether every neck of the outline is wide enough to hold rows of cells."""
    core = outline.buffer(-NARROWEST / 2)
    return bool(outline.is_valid and not core.is_empty and core.geom_type == "Polygon")


def _standing(proposed: list[Tether], outline: shapely.Polygon) -> tuple[Tether, ...]:
    """The proposed tethers that lie in the outline and clear of earlier ones."""
    kept: list[Tether] = []
    for tether in proposed:
        thin = tether.radius if isinstance(tether, Circle) else 1.01 * SMALLEST_TETHER
        if thin < SMALLEST_TETHER or not tether.polygon.is_valid or tether.polygon.is_empty:
            continue
        apart = all(tether.polygon.distance(other.polygon) >= GAP for other in kept)
        if apart and tether.stands_in(outline):
            kept.append(tether)
    return tuple(kept)


def _placed(
    rng: Generator, outline: shapely.Polygon, tethers: tuple[Tether, ...], reach: float
) -> tuple[shapely.Polygon, tuple[Tether, ...]] | None:
    """Rotated and shifted, mostly centred along x or y, otherwise at random; None if it does not fit."""
    angle = float(rng.choice([0.0, 90.0]) if rng.random() < 0.65 else rng.uniform(0, 180))
    turned = rotate(outline, angle, origin=(0, 0))
    x0, y0, x1, y1 = turned.bounds
    room = np.array([reach - (x1 - x0) / 2, reach - (y1 - y0) / 2])
    if (room < 0).any():
        return None
    offset = np.zeros(2) if rng.random() < 0.65 else rng.uniform(-room, room)
    x, y = offset - ((x0 + x1) / 2, (y0 + y1) / 2)
    return translate(turned, x, y), tuple(_moved(tether, angle, float(x), float(y)) for tether in tethers)


def _moved(tether: Tether, angle: float, x: float, y: float) -> Tether:
    """A tether rotated by degrees about the origin, then shifted."""
    if isinstance(tether, Circle):
        centre = rotate(shapely.Point(tether.x, tether.y), angle, origin=(0, 0))
        return Circle(centre.x + x, centre.y + y, tether.radius)
    return PolygonTether(translate(rotate(tether.polygon, angle, origin=(0, 0)), x, y))
