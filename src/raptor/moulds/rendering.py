"""Visible shapes of an SVG drawing, their positions and visibility, by a renderer (resvg).

The renderer applies style sheets, visibility, transforms and viewports. It returns bounding boxes, so it is
called four times: for the drawing itself, and with every shape shrunk to a point at the origin of its own
coordinates, and along x and y from there. The three points give each shape's matrix.
"""

import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from dataclasses import dataclass
from io import BytesIO
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import resvg
from numpy.typing import NDArray
from PIL import Image

from raptor.core.errors import RaptorError

SHAPES = ("path", "polygon", "polyline", "rect", "circle", "ellipse", "line")
SVG = "{http://www.w3.org/2000/svg}"
LINKS = ("href", "{http://www.w3.org/1999/xlink}href")
LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"
NAME = "data-raptor-name"  # original id of an element
FRAME = "raptor-frame"  # id of a shape of ours, whose matrix is that of the drawing
CANVAS = 65536  # pixels along the longer side: bounding boxes have single precision and three decimals
RASTER = 128  # pixels along the longer side of an inspected shape
FAINTEST = 3  # of 255: smallest visible opacity
HIDDEN = "visibility:hidden!important"
UNPAINTED = "display:inline!important;transform:none!important;fill:none;stroke:none"
NO_TEXT = "text,image,foreignObject{display:none!important}"
CLEAR = "*{opacity:1!important}"
UNCUT = "*{clip-path:none!important;mask:none!important;filter:none!important}"
SOLID = "fill:#000!important;fill-opacity:1!important;stroke:none!important"
DEEPEST = 8  # levels of clones of clones
MOST_SHAPES = 3000
ASK = "from resvg.__main__ import entrypoint; entrypoint()"  # the command `resvg`, wherever installed


@dataclass(frozen=True)
class Drawn:
    """A visible shape.

    Parameters
    ----------
    element : Element
        With its own attributes; a clone has those of its original.
    words : tuple of str
        Its id, classes and labels, and those of its groups, nearest first.
    matrix : array (2, 3)
        From the element's coordinates to the drawing's user units, y down.
    box : array (4,)
        x, y, width and height of its bounding box, user units.
    filled : bool
        Whether it is closed by its kind, or visible without its stroke.
    left : float
        The share left by clips and masks.
    """

    element: Element
    words: tuple[str, ...]
    matrix: NDArray[np.float64]
    box: NDArray[np.float64]
    filled: bool
    left: float


def drawn_shapes(root: Element, page: tuple[float, float]) -> list[Drawn]:
    """The visible shapes of a document, in drawing order.

    Parameters
    ----------
    root : Element
        The document's `svg` element; not changed.
    page : (float, float)
        Width and height of the page, CSS pixels.

    Raises
    ------
    RaptorError
        If the renderer rejects the document, or it has too many shapes.
    """
    document = _prepared(root, page)
    elements = {element.get("id", ""): element for element in document.iter() if tag_of(element) in SHAPES}
    parents = {part: element for element in document.iter() for part in element}
    boxes, matrices = _places(document, page)
    frame = matrices.pop(FRAME)
    names = [name for name in boxes if name in elements and name in matrices]
    if len(names) > MOST_SHAPES:
        raise RaptorError(f"it draws {len(names)} shapes; a mould is an outline and its tethers: keep those")
    shapes = []
    for name, look in zip(names, _looks(document, page, [elements[n] for n in names], boxes), strict=True):
        matrix = np.asarray(np.linalg.solve(frame, matrices[name]), dtype=np.float64)
        corner = np.linalg.solve(frame, [*boxes[name][:2], 1])[:2]
        box = np.append(corner, boxes[name][2:] / np.abs(np.diag(frame)[:2]))
        if look is not None and abs(np.linalg.det(matrix)) > 0:
            words = tuple(_words(elements[name], parents))
            shapes.append(Drawn(elements[name], words, matrix[:2], box, *look))
    return shapes


def tag_of(element: Element) -> str:
    """An element's name without its namespace."""
    return str(element.tag).rsplit("}", 1)[-1]


def _words(element: Element | None, parents: dict[Element, Element]) -> Iterator[str]:
    """Names of an element and of its groups."""
    while element is not None:
        yield from (element.get(NAME, element.get("id", "")), *element.get("class", "").split())
        yield element.get(LABEL, "")
        element = parents.get(element)


def _prepared(root: Element, page: tuple[float, float]) -> Element:
    """A copy of a document with its clones expanded, an id for every shape, and a shape of ours."""
    document = deepcopy(root)
    for key in ("x", "y"):  # meaningless on an outermost element
        document.attrib.pop(key, None)
    document.attrib |= {"width": repr(page[0]), "height": repr(page[1]), "overflow": "visible"}
    known = {element.get("id"): element for element in reversed(list(document.iter()))}
    _draw_out(document, {name: deepcopy(element) for name, element in known.items() if name}, [0], 0)
    taken: set[str] = set()
    for number, element in enumerate(document.iter()):
        name = element.get("id")
        if tag_of(element) in SHAPES and (name is None or name in taken):
            element.set(NAME, name or "")
            element.set("id", name := f"raptor-{number}")
        taken.add(name or "")
    document.append(Element(f"{SVG}ellipse", {"id": FRAME, "style": UNPAINTED, "rx": "1", "ry": "1"}))
    return document


def _draw_out(element: Element, known: dict[str, Element], made: list[int], depth: int) -> None:
    """Replace each `use` within an element by a copy of its target, so that the parts keep their ids.

    `made` counts the clones; a clone of a clone has `depth` 1.
    """
    for part in element:
        if tag_of(part) != "use":
            _draw_out(part, known, made, depth)
            continue
        made[0] += 1
        if made[0] > MOST_SHAPES:
            raise RaptorError(f"it has more than {MOST_SHAPES} clones; a mould is an outline and its tethers")
        target = known.get(next((part.attrib.pop(key) for key in LINKS if key in part.attrib), "")[1:])
        x, y, *size = (part.attrib.pop(key, "") for key in ("x", "y", "width", "height"))
        part.tag = f"{SVG}g"
        if target is None or depth >= DEEPEST:
            continue
        shown = deepcopy(target)
        if tag_of(shown) in ("symbol", "svg"):
            shown.tag = f"{SVG}svg"
            sides = zip(("width", "height"), size, strict=True)
            shown.attrib |= {key: side or shown.get(key, "100%") for key, side in sides}
        # The position applies after the transform of the clone.
        place = Element(f"{SVG}svg", {"x": x or "0", "y": y or "0", "overflow": "visible"})
        place.append(shown)
        part.append(place)
        _draw_out(place, known, made, depth + 1)


def _as_points(document: Element, point: tuple[float, float]) -> Element:
    """A document with each shape shrunk to a point (x, y) of its own coordinates."""
    x, y = (repr(value) for value in point)
    half = 1e-4 * max(1.0, max(point))
    corner = {"x": repr(point[0] - half), "y": repr(point[1] - half)}
    shrunk = {
        "path": {"d": f"M{x} {y}L{x} {y}"},
        "polygon": {"points": f"{x} {y} {x} {y}"},
        "polyline": {"points": f"{x} {y} {x} {y}"},
        "rect": corner | {"width": repr(2 * half), "height": repr(2 * half)},
        "circle": {"cx": x, "cy": y, "r": repr(half)},
        "ellipse": {"cx": x, "cy": y, "rx": repr(half), "ry": repr(half)},
        "line": {"x1": x, "y1": y, "x2": x, "y2": y},
    }
    document = deepcopy(document)
    for element in document.iter():
        element.attrib |= shrunk.get(tag_of(element), {})
    return document


def _text(inner: str, size: tuple[float, float], view: tuple[float, float, float, float]) -> str:
    """A document, as text, that shows the part `view` (x, y, width, height) of another on `size` pixels."""
    box = " ".join(f"{value:.9g}" for value in view)
    sides = f'width="{size[0]:.9g}" height="{size[1]:.9g}"'
    return f'<svg xmlns="{SVG[1:-1]}" {sides} viewBox="{box}">{inner}</svg>'


def _as_text(document: Element) -> str:
    return ElementTree.tostring(document, encoding="unicode")


def _boxes(text: str) -> dict[str, NDArray[np.float64]]:
    """Bounding boxes (x, y, width, height) of all drawn elements with an id, pixels."""
    command = [sys.executable, "-P", "-c", ASK, "--query-all", "--skip-system-fonts", "--quiet", "-"]
    run = subprocess.run(command, input=text.encode(), capture_output=True, check=False)
    if run.returncode:
        said = run.stderr.decode(errors="replace").strip().splitlines()
        raise RaptorError(f"the renderer cannot draw it: {said[-1] if said else 'it stopped'}")
    lines = [line.rsplit(",", 4) for line in run.stdout.decode().splitlines()]
    return {parts[0]: np.array(parts[1:], dtype=float) for parts in lines if len(parts) == 5}


def _places(
    document: Element, page: tuple[float, float]
) -> tuple[dict[str, NDArray[np.float64]], dict[str, NDArray[np.float64]]]:
    """Bounding boxes (4,) and matrices (3, 3) of drawn elements, by id, in CSS pixels of the page."""
    zoom, far = CANVAS / max(page), max(page)
    size, view = (zoom * page[0], zoom * page[1]), (0.0, 0.0, *page)
    points = ((0.0, 0.0), (far, 0.0), (0.0, far))
    questions = [document, *(_as_points(document, point) for point in points)]
    with ThreadPoolExecutor() as pool:
        answers = list(pool.map(_boxes, [_text(_as_text(question), size, view) for question in questions]))
    boxes, *corners = [{name: box / zoom for name, box in answer.items()} for answer in answers]
    middles = [{name: box[:2] + box[2:] / 2 for name, box in each.items()} for each in corners]
    matrices = {}
    for name, origin in middles[0].items():
        if all(name in each for each in middles):
            along = [(each[name] - origin) / far for each in middles[1:]]
            matrices[name] = np.vstack([np.column_stack([*along, origin]), [0.0, 0.0, 1.0]])
    if FRAME not in matrices:
        raise RaptorError("nothing of it is visible; check its width, height and viewBox")
    return boxes, matrices


def _looks(
    document: Element, page: tuple[float, float], shapes: list[Element], boxes: dict[str, NDArray[np.float64]]
) -> list[tuple[bool, float] | None]:
    """For each shape whether it is filled, and the share left by clips; None if invisible."""
    document = deepcopy(document)
    ElementTree.SubElement(document, f"{SVG}style").text = NO_TEXT
    names = {shape.get("id", ""): number for number, shape in enumerate(shapes)}
    for element in document.iter():
        number = names.get(element.get("id", ""))
        if number is not None:
            # The renderer ignores properties that it does not know.
            own = element.get("style", "").strip(" ;\n\t")
            element.set("style", f"{own};{HIDDEN};raptor:{number};".strip(";") + ";")
    whole_text, looks = _as_text(document), list[tuple[bool, float] | None]()
    for number, shape in enumerate(shapes):
        x, y, width, height = boxes[shape.get("id", "")]
        margin = 0.05 * max(width, height, 1e-6 * max(page))
        view = (x - margin, y - margin, width + 2 * margin, height + 2 * margin)
        zoom = RASTER / max(view[2:])
        text = _text(whole_text, (max(zoom * view[2], 1.0), max(zoom * view[3], 1.0)), view)

        def opacity(style: str, sheet: str = "", text: str = text, number: int = number) -> Any:
            shown = text.replace(f"{HIDDEN};raptor:{number};", style)
            return _alpha(shown.replace(NO_TEXT, NO_TEXT + sheet))

        if opacity(f"stroke-width:{0.4 * margin:.9f}").max() < FAINTEST:  # a hairline is visible too
            looks.append(None)
            continue
        left = 1.0
        if "clip-path" in text or "mask" in text:
            whole = opacity(SOLID, CLEAR + UNCUT).sum()
            left = float(opacity(SOLID, CLEAR).sum() / whole) if whole > 0 else 1.0
        may_be_open = tag_of(shape) in ("path", "polyline", "line")
        filled = not may_be_open or bool(opacity("stroke:none!important").max() >= FAINTEST)
        looks.append((filled, left))
    return looks


def _alpha(text: str) -> NDArray[np.float64]:
    """Opacity (row, column) of a rendered document, 0 to 255."""
    tree = resvg.usvg.Tree.from_str(text, resvg.usvg.Options.default())
    picture = Image.open(BytesIO(resvg.render(tree, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0))))
    return np.asarray(picture.convert("RGBA"), dtype=float)[..., 3]
