"""The paper's standard moulds, and documented approximations of the moulds that tissues grew in.

The paper states that the test mould is a rectangle of 1:2 with a tether in each corner, and that the
I-shape holds its tissue by two long bars in place of six tethering points; it states no sizes. Sizes
here are such that seven layers hold about 10,000 cells, the paper's number. Outlines of the
tissues' moulds are drawn in the paper but not given in numbers: each is an approximation by what
its text and the cited experiments say, made before any fit. Lengths in l0.
"""

from collections.abc import Callable
from itertools import product

import shapely

from raptor.moulds.geometry import Circle, Mould, PolygonTether, Tether

POST = 1.5  # radius of a post
RIM = 4.0  # from a post's centre to the two nearest edges


def four_post_rectangle() -> Mould:
    """Rectangle, 1:2, a post in each corner (paper; O'Rourke 2015, Hague 2019)."""
    return _posted_rectangle(53.0, 26.5, "four_post_rectangle")


def reference_rectangle() -> Mould:
    """Rectangle, 50 x 25, a post in each corner: what solvers are measured on."""
    return _posted_rectangle(50.0, 25.0, "reference_rectangle")


def small_rectangle() -> Mould:
    """Rectangle, 26 x 13, a post in each corner: small enough for the paper's whole schedule."""
    return _posted_rectangle(26.0, 13.0, "small_rectangle", post=1.0, rim=2.5)


def free_square() -> Mould:
    """Square without tethers: a gel that contracts freely."""
    return Mould(shapely.box(-12, -12, 12, 12), (), "square", "free_square")


def i_shape() -> Mould:
    """I-shape with a long tethering bar in each end (paper)."""
    return Mould(_i_outline(), _bars(21.0, 21.0, 1.5), "mirrors", "i_shape")


def glial_1() -> Mould:
    """Rectangle, 1:2, a post in each corner: the mould drawn widest in the paper's table."""
    return _posted_rectangle(53.0, 26.5, "glial_1")


def glial_2() -> Mould:
    """I-shape, three posts in each end: the six tethering points that the paper mentions."""
    posts = _posts(21.0, (-10.0, 0.0, 10.0))
    return Mould(_i_outline(), posts, "mirrors", "glial_2")


def glial_3() -> Mould:
    """Rectangle, 3:4, a post in each corner: a wider tissue of the same kind."""
    return _posted_rectangle(44.0, 33.0, "glial_3")


def fibroblast() -> Mould:
    """Rectangle, 1:2, held by a bar along each short side, as the lattices of Kostyuk (2004)."""
    return _barred_rectangle(53.0, 26.5, "fibroblast")


def corneal() -> Mould:
    """Rectangle, 30 x 10 mm, held by two bars across the ends (Mukhey 2018)."""
    return _barred_rectangle(57.0, 19.0, "corneal")


def tenocyte() -> Mould:
    """Long strip held at its two ends, as the constructs of Garvin (2003)."""
    return _barred_rectangle(57.0, 12.0, "tenocyte")


def myoblast() -> Mould:
    """Strip with a pair of posts at each end, as the moulds of Capel (2019)."""
    return Mould(shapely.box(-28, -9, 28, 9), _posts(23.0, (-4.5, 4.5)), "mirrors", "myoblast")


STANDARD: dict[str, Callable[[], Mould]] = {
    function.__name__: function
    for function in (
        four_post_rectangle, reference_rectangle, small_rectangle, free_square, i_shape,
        glial_1, glial_2, glial_3, fibroblast, corneal, tenocyte, myoblast,
    )
}  # fmt: skip
"""Every standard mould by name, as it stands in config/moulds/."""


def _posted_rectangle(width: float, height: float, name: str, post: float = POST, rim: float = RIM) -> Mould:
    outline = shapely.box(-width / 2, -height / 2, width / 2, height / 2)
    posts = _posts(width / 2 - rim, (rim - height / 2, height / 2 - rim), post)
    return Mould(outline, posts, "mirrors", name)


def _barred_rectangle(width: float, height: float, name: str) -> Mould:
    outline = shapely.box(-width / 2, -height / 2, width / 2, height / 2)
    return Mould(outline, _bars(width / 2 - RIM, height - 4.0, 1.5), "mirrors", name)


def _i_outline() -> shapely.Polygon:
    """Two wide ends and a narrower waist."""
    right = [(14.0, -9.0), (17.0, -15.0), (26.0, -15.0), (26.0, 15.0), (17.0, 15.0), (14.0, 9.0)]
    return shapely.Polygon(right + [(-x, -y) for x, y in right])


def _posts(x: float, heights: tuple[float, ...], radius: float = POST) -> tuple[Tether, ...]:
    return tuple(Circle(side * x, y, radius) for side, y in product((-1, 1), heights))


def _bars(x: float, length: float, width: float) -> tuple[Tether, ...]:
    """An upright bar of a length and width at -x and one at x."""
    half, reach = width / 2, length / 2
    return tuple(
        PolygonTether(shapely.box(side * x - half, -reach, side * x + half, reach)) for side in (-1, 1)
    )
