"""The eight elements of D4, and how they move images, vectors and tensor fields.

Element = mirror x -> -x first where `mirror`, then counter-clockwise quarter turns.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from raptor.core.arrays import Array, library_of

FIELDS = ("density", "tension", "sxsx", "sysy", "szsz", "sxsy", "sxsz", "sysz")
"""The eight output channels, in order."""


@dataclass(frozen=True, order=True)
class Element:
    """An element of D4.

    Parameters
    ----------
    quarter_turns : int
        Counter-clockwise quarter turns, 0 to 3, made after the mirror.
    mirror : bool
        Whether x changes sign first.
    """

    quarter_turns: int
    mirror: bool

    @classmethod
    def all(cls) -> tuple["Element", ...]:
        """The eight elements, the identity first."""
        return tuple(cls(turns, mirror) for mirror in (False, True) for turns in range(4))

    @classmethod
    def from_index(cls, index: int) -> "Element":
        """The element of an index 0 to 7, as it stands in example tables."""
        return cls.all()[index]

    @property
    def index(self) -> int:
        """Place among `all()`, 0 to 7."""
        return self.quarter_turns + 4 * self.mirror

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """The 2 x 2 orthogonal matrix that takes (x, y) to its image; entries are exactly 0, 1, -1."""
        turn = np.array([[0.0, -1.0], [1.0, 0.0]])
        matrix = np.diag([-1.0, 1.0]) if self.mirror else np.eye(2)
        for _ in range(self.quarter_turns):
            matrix = turn @ matrix
        return matrix

    @property
    def inverse(self) -> "Element":
        """The element that undoes this one."""
        return self if self.mirror else Element(-self.quarter_turns % 4, False)

    def __matmul__(self, first: "Element") -> "Element":
        """`first`, then this one."""
        turns = -first.quarter_turns if self.mirror else first.quarter_turns
        return Element((self.quarter_turns + turns) % 4, self.mirror != first.mirror)

    @cached_property
    def channel_matrix(self) -> NDArray[np.float64]:
        """The signed permutation (8, 8) that takes the channels `FIELDS` to their images.

        Density, tension and szsz are scalars, (sxsz, sysz) is a vector, and
        [[sxsx, sxsy], [sxsy, sysy]] a tensor of order 2: S -> R S R^T.
        """
        rotation = self.matrix
        matrix = np.zeros((8, 8))
        for scalar in (0, 1, 4):
            matrix[scalar, scalar] = 1.0
        matrix[6:, 6:] = rotation
        tensor = {2: (0, 0), 3: (1, 1), 5: (0, 1)}
        for image, (a, b) in tensor.items():
            matrix[image, 2] = rotation[a, 0] * rotation[b, 0]
            matrix[image, 3] = rotation[a, 1] * rotation[b, 1]
            matrix[image, 5] = rotation[a, 0] * rotation[b, 1] + rotation[a, 1] * rotation[b, 0]
        return matrix

    @cached_property
    def permutation(self) -> list[tuple[int, float]]:
        """`channel_matrix` as the channel that each image is made from, and its sign."""
        source = np.abs(self.channel_matrix).argmax(axis=1)
        return list(zip(source.tolist(), self.channel_matrix[np.arange(8), source].tolist(), strict=True))


def move_pixels(image: Array, element: Element) -> Array:
    """Move the pixels of a square image (..., y, x), rows ascending in y; values unchanged.

    numpy arrays and torch tensors alike.
    """
    arrays = library_of(image)
    moved = arrays.flip(image, (-1,)) if element.mirror else image
    # rot90 turns rows that descend in y counter-clockwise; ours ascend, hence the sign.
    return arrays.rot90(moved, -element.quarter_turns, (-2, -1))  # type: ignore[no-any-return]


def apply(fields: Array, element: Element) -> Array:
    """Transform a field stack (..., 8, y, x) in the order `FIELDS` as tensors of order 0, 1 and 2.

    numpy arrays and torch tensors alike. Scaled stacks transform alike, since the scaling commutes with
    D4 (dataset.scaling).
    """
    moved = move_pixels(fields, element)
    images = [sign * moved[..., channel, :, :] for channel, sign in element.permutation]
    return library_of(fields).stack(images, -3)  # type: ignore[no-any-return]
