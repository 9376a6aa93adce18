"""The cast lattice: face-centred cubic, (001) planes horizontal, and the bonds between its sites."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raptor.moulds.cast import HALF_SPAN, cast_sites
from raptor.moulds.geometry import Mould
from raptor.parameters import SHELL_DISTANCE, CellParameters, NetworkModel


@dataclass(frozen=True)
class Lattice:
    """Sites of the cells and the bonds between them.

    Parameters
    ----------
    sites : ndarray (cells, 3)
        Cast positions x, y, z in l0, ordered by layer, then y, then x.
    first, second : ndarray (bonds,)
        The two cells of each bond, each bond once; grouped by direction, so that cells of
        consecutive bonds are mostly neighbours in memory.
    stiffness, rest_length : ndarray (bonds,)
        Spring constant in kappa0 and rest length in l0; bonds of zero stiffness are not built.
    height : float
        Fill height, l0.
    """

    sites: NDArray[np.float64]
    first: NDArray[np.int32]
    second: NDArray[np.int32]
    stiffness: NDArray[np.float64]
    rest_length: NDArray[np.float64]
    height: float

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.sites)

    @property
    def bonds(self) -> int:
        """Number of bonds."""
        return len(self.first)


def shell_offsets(distance: float) -> NDArray[np.int64]:
    """Half of a shell's bonds, one of each pair, as (dx, dy, dk) in half l0, half l0 and layers.

    A face-centred-cubic site has neighbours where dx, dy (in halves) and the layer step dk have
    equal parity, at squared distance dx^2/4 + dy^2/4 + dk^2/2.
    """
    span = range(-4, 5)
    offsets = [
        (dx, dy, dk)
        for dk in range(3)
        for dy in span
        for dx in span
        if dx % 2 == dy % 2 == dk % 2
        and abs(dx * dx / 4 + dy * dy / 4 + dk * dk / 2 - distance**2) < 1e-9
        and (dk, dy, dx) > (0, 0, 0)
    ]
    return np.array(offsets, dtype=np.int64).reshape(-1, 3)


def build_lattice(mould: Mould, parameters: CellParameters, model: NetworkModel) -> Lattice:
    """Cast a mould: sites inside its depression, and the bonds between them.

    Raises
    ------
    RaptorError
        If no site lies inside the depression.
    """
    return connect(cast_sites(mould, model.layers), parameters, model)


def connect(sites: NDArray[np.float64], parameters: CellParameters, model: NetworkModel) -> Lattice:
    """Build the bonds between cast sites (cells, 3), ordered by layer, then y, then x."""
    index = site_numbers(sites, model.layers)
    kappas = (1.0, parameters.kappa_nnn, parameters.kappa_nnnn)
    groups = [
        (*_bonds_along(index, offset), kappa, SHELL_DISTANCE[shell])
        for shell, kappa in zip(model.shells, kappas, strict=True)
        if kappa > 0
        for offset in shell_offsets(SHELL_DISTANCE[shell])
    ]
    counts = [len(group[0]) for group in groups]
    return Lattice(
        sites=sites,
        first=np.concatenate([group[0] for group in groups]),
        second=np.concatenate([group[1] for group in groups]),
        stiffness=np.repeat([group[2] for group in groups], counts),
        rest_length=np.repeat([group[3] for group in groups], counts),
        height=model.height,
    )


def site_numbers(sites: NDArray[np.float64], layers: int) -> NDArray[np.int32]:
    """Number of the site at each place of the grid [layer, y, x] of half l0, -1 where empty."""
    layer = np.rint(sites[:, 2] * np.sqrt(2) - 0.5).astype(int)
    column, row = (np.rint(2 * sites[:, axis]).astype(int) + 2 * HALF_SPAN for axis in (0, 1))
    side = 4 * HALF_SPAN + 2
    index = np.full((layers, side, side), -1, dtype=np.int32)
    index[layer, row, column] = np.arange(len(sites), dtype=np.int32)
    return index


def _bonds_along(
    index: NDArray[np.int32], offset: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Every pair of cells a given offset (dx, dy, dk) apart, in the order of the first cell."""
    dx, dy, dk = (int(step) for step in offset)
    layers, rows, columns = index.shape

    def window(step: int, size: int) -> tuple[slice, slice]:
        return slice(max(0, -step), size - max(0, step)), slice(max(0, step), size + min(0, step))

    if dk >= layers:
        return np.empty(0, np.int32), np.empty(0, np.int32)
    (k0, k1), (y0, y1), (x0, x1) = window(dk, layers), window(dy, rows), window(dx, columns)
    first, second = index[k0, y0, x0], index[k1, y1, x1]
    both = (first >= 0) & (second >= 0)
    return first[both], second[both]
