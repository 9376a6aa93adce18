"""Walls: the mould's outline, its tethers, its floor and the fill height repel cells.

The paper's "large penalty" is a stiff spring, stiffness / 2 * depth^2 for a cell at `depth` inside a wall.
The depth in the plane is tabulated once per mould and interpolated by a quadratic B-spline: its gradient is
continuous, straight walls are exact, corners are rounded over a few tenths of l0, and the cost is
independent of the number of tethers.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raptor.core.compiled import kernel
from raptor.moulds.geometry import Mould

SPACING = 0.25  # of the table, l0
RIM = 2.0  # l0; margin of the table beyond the outline
STIFFNESS = 100.0  # kappa0; a few times the combined stiffness of a cell's bonds


class Walls(NamedTuple):
    """A table of depths (rows in y, columns in x), its origin, and the vertical bounds, l0.

    `near` says for each square of the table whether a wall could be within reach.
    """

    depth: NDArray[np.float64]
    near: NDArray[np.uint8]
    x0: float
    y0: float
    height: float
    stiffness: float


NO_WALLS = Walls(np.full((3, 3), -1e6), np.zeros((3, 3), np.uint8), 0.0, 0.0, 1e9, 0.0)
"""For the energy of bonds alone."""


def build_walls(mould: Mould, height: float, stiffness: float = STIFFNESS) -> Walls:
    """Tabulate the depth of points of the plane in the walls of a mould."""
    x0, y0, x1, y1 = mould.outline.bounds
    x = np.arange(x0 - RIM, x1 + RIM + 2 * SPACING, SPACING)
    y = np.arange(y0 - RIM, y1 + RIM + 2 * SPACING, SPACING)
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    depth = mould.forbidden_depth(grid.reshape(-1, 2)).reshape(grid.shape[:2])
    # Depth changes by at most 1 a length: by 1.42 spacings to a square's far corner, and the
    # spline's knots lie 0.75 spacings from a point in the (weighted) mean.
    near = depth > -2.25 * SPACING
    return Walls(depth, near.astype(np.uint8), float(x[0]), float(y[0]), float(height), float(stiffness))


@kernel
def _depth_kernel(x, y, walls):
    """Depth in a wall at (x, y), and its gradient, by a quadratic B-spline over 3 x 3 knots."""
    rows, columns = walls.depth.shape
    u = (x - walls.x0) / SPACING
    v = (y - walls.y0) / SPACING
    column = min(max(int(np.floor(u + 0.5)), 1), columns - 2)
    row = min(max(int(np.floor(v + 0.5)), 1), rows - 2)
    u -= column
    v -= row
    # Weights of the knots -1, 0, 1 at offset u in [-1/2, 1/2], and their derivatives.
    au, bu, cu = 0.5 * (0.5 - u) ** 2, 0.75 - u * u, 0.5 * (0.5 + u) ** 2
    dau, dbu, dcu = u - 0.5, -2.0 * u, u + 0.5
    av, bv, cv = 0.5 * (0.5 - v) ** 2, 0.75 - v * v, 0.5 * (0.5 + v) ** 2
    dav, dbv, dcv = v - 0.5, -2.0 * v, v + 0.5
    d = walls.depth
    low = au * d[row - 1, column - 1] + bu * d[row - 1, column] + cu * d[row - 1, column + 1]
    mid = au * d[row, column - 1] + bu * d[row, column] + cu * d[row, column + 1]
    top = au * d[row + 1, column - 1] + bu * d[row + 1, column] + cu * d[row + 1, column + 1]
    dlow = dau * d[row - 1, column - 1] + dbu * d[row - 1, column] + dcu * d[row - 1, column + 1]
    dmid = dau * d[row, column - 1] + dbu * d[row, column] + dcu * d[row, column + 1]
    dtop = dau * d[row + 1, column - 1] + dbu * d[row + 1, column] + dcu * d[row + 1, column + 1]
    depth = av * low + bv * mid + cv * top
    gradient_x = (av * dlow + bv * dmid + cv * dtop) / SPACING
    gradient_y = (dav * low + dbv * mid + dcv * top) / SPACING
    return depth, gradient_x, gradient_y


@kernel
def near_kernel(x, y, z, walls):
    """Whether a cell at (x, y, z) could touch a wall, the floor or the fill height."""
    rows, columns = walls.near.shape
    column = int((x - walls.x0) / SPACING)
    row = int((y - walls.y0) / SPACING)
    inside = 0 <= column < columns and 0 <= row < rows and 0.0 <= z <= walls.height
    return not inside or walls.near[row, column] != 0


@kernel
def wall_energy_kernel(x, y, z, walls):
    """Wall energy of one cell (kappa0 l0^2), and its gradient along x, y and z (kappa0 l0)."""
    if not near_kernel(x, y, z, walls):
        return 0.0, 0.0, 0.0, 0.0
    depth, along_x, along_y = _depth_kernel(x, y, walls)
    below = max(0.0, -z) - max(0.0, z - walls.height)
    push = walls.stiffness * max(0.0, depth)
    energy = 0.5 * (push * max(0.0, depth) + walls.stiffness * below * below)
    return energy, push * along_x, push * along_y, -walls.stiffness * below
