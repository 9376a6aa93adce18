"""A mould in numbers."""

from dataclasses import dataclass, field

import shapely

from raptor.moulds.cast import cast_sites
from raptor.moulds.geometry import Mould, depth
from raptor.moulds.random_moulds import GROUPS
from raptor.parameters import LAYERS
from raptor.symmetry import Element

ALIKE = 0.25  # l0; largest distance between the walls of a mould and its symmetry image


@dataclass(frozen=True)
class Summary:
    """Measures of a mould.

    Parameters
    ----------
    mould : str
        Its name.
    width, height : float
        Of the outline's bounding box along x and y, l0.
    area : float
        Of the depression, without tethers, l0^2.
    tethers : int
        Their number.
    symmetry : str
        Its class, a key of `random_moulds.GROUPS`, found from its shape.
    layers, cells : int
        Number of cells in the given number of layers.
    mm_per_l0 : float or None
        Millimetres per l0, if it was drawn in a real unit.
    scaled : str
        Description of how a drawing was scaled.
    """

    mould: str
    width: float
    height: float
    area: float
    tethers: int
    symmetry: str
    layers: int
    cells: int
    mm_per_l0: float | None = field(default=None, compare=False)
    scaled: str = field(default="", compare=False)

    @property
    def rows(self) -> dict[str, str]:
        """The measures as text, by name."""
        mm = self.mm_per_l0
        real = f" ({self.width * mm:.4g} x {self.height * mm:.4g} mm)" if mm else ""
        deep = f" ({depth(self.layers) * mm:.3g} mm deep)" if mm else ""
        scaled = {"scale": self.scaled} if self.scaled else {}
        return {
            "mould": self.mould,
            **scaled,
            "size": f"{self.width:.4g} x {self.height:.4g} l0{real}",
            "area": f"{self.area:.5g} l0^2",
            "tethers": f"{self.tethers}",
            "symmetry": self.symmetry.replace("_", " "),
            "cells": f"{self.cells:,} in {self.layers} layers{deep}",
        }


def summarise(mould: Mould, layers: int = LAYERS) -> Summary:
    """Measure a mould, cast with a number of layers.

    Raises
    ------
    RaptorError
        If it holds no cell.
    """
    x0, y0, x1, y1 = mould.outline.bounds
    return Summary(
        mould.name,
        x1 - x0,
        y1 - y0,
        mould.depression.area,
        len(mould.tethers),
        symmetry_class(mould),
        layers,
        len(cast_sites(mould, layers)),
        mould.mm_per_l0,
        mould.note,
    )


def area_apart(mould: Mould, other: Mould) -> float:
    """Area of the symmetric difference of two depressions, over that of the second."""
    return float(mould.depression.symmetric_difference(other.depression).area / other.depression.area)


def symmetry_class(mould: Mould) -> str:
    """The largest symmetry class, a key of `random_moulds.GROUPS`, whose elements leave a mould unchanged.

    Elements act about the origin; a mirror may have either axis. Walls may differ by 0.25 l0, so that a
    painted copy of a mould has the same class.
    """
    kept = {element for element in Element.all() if _looks_alike(mould, element)}
    turns = (Element(0, False), Element(1, False))
    classes = [
        name
        for name, group in GROUPS.items()
        if any({turn @ element @ turn.inverse for element in group} <= kept for turn in turns)
    ]
    return max(classes, key=lambda name: len(GROUPS[name]))


def _looks_alike(mould: Mould, element: Element) -> bool:
    """Whether a mould is unchanged under an element."""
    moved = mould.transformed(element.matrix)
    pairs = [(mould.outline, moved.outline)]
    if mould.tethers:
        pairs.append((_tethers(mould), _tethers(moved)))
    return all(shapely.hausdorff_distance(ours.boundary, theirs.boundary) <= ALIKE for ours, theirs in pairs)


def _tethers(mould: Mould) -> shapely.Geometry:
    return shapely.union_all([tether.polygon for tether in mould.tethers])
