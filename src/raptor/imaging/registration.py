"""Where the mould lies in a picture: the similarity that takes l0 to pixels.

Pixels are (column, row), row 0 at the top; pixel centres have integer coordinates. The mould's y axis
points up and rows run down. A picture taken from below, or through a mirror, is `mirrored`.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from skimage.draw import polygon2mask
from skimage.transform import SimilarityTransform

from raptor.core.errors import RaptorError
from raptor.frame import IMAGE_SIZE
from raptor.moulds import Mould

MAX_LANDMARK_RESIDUAL = 0.5  # l0, root mean square
NUMBER = r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*"
LANDMARK = re.compile(rf"{NUMBER},{NUMBER}=(?:{NUMBER},{NUMBER}|\s*tether\s*(\d+)\s*)")


class RegistrationError(RaptorError):
    """The mould was found in the picture, but not well enough; `registration` is where."""

    def __init__(self, sentence: str, registration: "Registration") -> None:
        super().__init__(sentence)
        self.registration = registration


@dataclass(frozen=True)
class Registration:
    """A similarity from the mould to the picture.

    Parameters
    ----------
    matrix : array (3, 3)
        Takes (x, y, 1) in l0 to (column, row, 1).
    method : str
        "rim", "landmarks" or "frame" (the picture's borders).
    residual : float
        Root mean square distance between observed and expected positions, l0; NaN if there are no
        positions beyond those that determine the similarity.
    """

    matrix: NDArray[np.float64]
    method: str
    residual: float

    @property
    def scale(self) -> float:
        """Pixels of the picture per l0."""
        return float(np.sqrt(abs(np.linalg.det(self.matrix[:2, :2]))))

    @property
    def angle(self) -> float:
        """Direction of the mould's x axis in the picture, degrees counter-clockwise."""
        return float(np.degrees(np.arctan2(-self.matrix[1, 0], self.matrix[0, 0]))) + 0.0  # no -0

    def to_pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 2) in l0 as columns and rows (n, 2)."""
        return points @ self.matrix[:2, :2].T + self.matrix[:2, 2]

    def to_mould(self, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Columns and rows (n, 2) as points (n, 2) in l0."""
        return (pixels - self.matrix[:2, 2]) @ np.linalg.inv(self.matrix[:2, :2]).T

    def covers(self, shape: shapely.Geometry, size: tuple[int, ...]) -> NDArray[np.bool_]:
        """Pixels (row, column) whose centres lie in a shape without holes, l0; `size` is the picture's."""
        inside = np.zeros(size, dtype=bool)
        for part in shapely.get_parts(shape):
            corners = self.to_pixels(shapely.get_coordinates(part.exterior))
            inside |= polygon2mask(size, corners[:, ::-1])
        return inside


def aligned(size: tuple[int, ...]) -> Registration:
    """The registration of a square picture that spans the mould's frame, highest y at the top.

    Raises
    ------
    RaptorError
        If the picture is not square.
    """
    rows, columns = size
    if rows != columns:
        raise RaptorError(
            f"the image is {columns} x {rows} pixels; an aligned one is square and spans {IMAGE_SIZE} l0, "
            "so crop it or drop --aligned"
        )
    scale, middle = rows / IMAGE_SIZE, (rows - 1) / 2
    matrix = np.array([[scale, 0, middle], [0, -scale, middle], [0, 0, 1]])
    return Registration(matrix, "frame", float("nan"))


def from_landmarks(
    pixels: NDArray[np.float64], points: NDArray[np.float64], mirrored: bool = False
) -> Registration:
    """The least-squares similarity from points (n, 2) in l0 to columns and rows (n, 2).

    Raises
    ------
    RaptorError
        If there are fewer than two, all lie in one place, or their residual is above 0.5 l0.
    """
    if len(points) < 2:
        raise RaptorError(f"{len(points)} landmark given; give at least two, three to get a residual")
    handed = points * (1, 1 if mirrored else -1)
    apart = min(float(np.ptp(handed, axis=0).max()), float(np.ptp(pixels, axis=0).max()))
    similarity = SimilarityTransform.from_estimate(handed, pixels) if apart > 1e-6 else None
    if not similarity:
        raise RaptorError("the landmarks lie in one place; give two that are far apart")
    matrix = np.asarray(similarity.params) @ np.diag([1, 1 if mirrored else -1, 1])
    found = Registration(matrix, "landmarks", float("nan"))
    misses = found.to_mould(pixels) - points
    residual = float(np.sqrt(np.mean(np.sum(misses**2, axis=1)))) if len(points) > 2 else float("nan")
    if residual > MAX_LANDMARK_RESIDUAL:
        worst = int(np.argmax(np.linalg.norm(misses, axis=1))) + 1
        raise RegistrationError(
            f"the landmarks do not fit the mould: residual {residual:.2f} l0, above "
            f"{MAX_LANDMARK_RESIDUAL}; check landmark {worst} first, then --mirrored",
            found,
        )
    return Registration(matrix, "landmarks", residual)


def parse_landmarks(
    landmarks: Sequence[str], mould: Mould
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Columns and rows (n, 2) and points (n, 2) in l0 of landmarks given on the command line.

    A landmark is "column,row=x,y", or "column,row=tether 1" for the centre of a tether in file order.

    Raises
    ------
    RaptorError
        If one has another form, or names a tether that the mould does not have.
    """
    pixels, points = [], []
    for landmark in landmarks:
        match = LANDMARK.fullmatch(landmark)
        if match is None:
            raise RaptorError(
                f"landmark '{landmark}' is not of the form column,row=x,y or column,row=tether 1"
            )
        column, row, x, y, number = match.groups()
        pixels.append((float(column), float(row)))
        points.append(_tether_centre(mould, int(number)) if number else (float(x), float(y)))
    return np.array(pixels, dtype=float).reshape(-1, 2), np.array(points, dtype=float).reshape(-1, 2)


def _tether_centre(mould: Mould, number: int) -> tuple[float, float]:
    if not 1 <= number <= len(mould.tethers):
        raise RaptorError(f"a landmark names tether {number}; {mould.name} has {len(mould.tethers)} of them")
    centre = mould.tethers[number - 1].polygon.centroid
    return float(centre.x), float(centre.y)
