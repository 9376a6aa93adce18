"""The lattice's bonds, laid out for the processor's vector registers.

Cells are ordered by layer, row and column, so neighbours of consecutive cells are mostly
consecutive cells. A **chunk** is a run of cells that fills one register; an **entry** of a chunk
is one register full of bonds, from cells `first` + t of the chunk to cells `second` + t, of one
kind (spring constant, rest length and direction at casting), with a bit for each lane t that holds a
bond. A kernel keeps a chunk's cells in registers and loops over its entries, without gathers.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from raptor.condor.lattice import Lattice
from raptor.condor.simd import lanes


class Network(NamedTuple):
    """Bonds in chunks and entries.

    Chunk c is cells `first[c]` to `first[c]` + `filled[c]`; its entries are `entries[c]` to
    `entries[c + 1]` of `second` (a cell, less than zero where low lanes hold no bond), `bits`
    and `kind`; bonds of a kind have `stiffness[kind]` (kappa0), `rest_length[kind]` (l0) and, at
    casting, `direction[kind]` (unit vectors).
    """

    first: NDArray[np.int32]
    filled: NDArray[np.int32]
    entries: NDArray[np.int64]
    second: NDArray[np.int32]
    bits: NDArray[np.uint16]
    kind: NDArray[np.int16]
    stiffness: NDArray[Any]
    rest_length: NDArray[Any]
    direction: NDArray[Any]

    @property
    def cells(self) -> int:
        """Number of cells."""
        return int(self.first[-1] + self.filled[-1])


def build_network(lattice: Lattice, precision: DTypeLike = np.float64) -> Network:
    """Lay out a lattice for its energy and gradient: each bond once, cells as in the lattice."""
    cells = np.arange(lattice.cells)
    low = np.minimum(lattice.first, lattice.second)
    high = np.maximum(lattice.first, lattice.second)
    return _layout(lattice, cells, _row(lattice), (low, high), precision)


def build_sublattices(
    lattice: Lattice, precision: DTypeLike = np.float64
) -> tuple[NDArray[np.int64], Network]:
    """Lay out a lattice for trial moves: no two cells of a chunk share a bond.

    Each row of cells is split into two or three interleaved sublattices. Returns the order of the cells,
    (cells,) numbers in the lattice, and the network of the cells in that order, which contains each bond
    from both ends.
    """
    row = _row(lattice)
    same = row[lattice.first] == row[lattice.second]
    reach = np.abs(lattice.sites[lattice.first, 0] - lattice.sites[lattice.second, 0])[same]
    apart = 1 + int(reach.max(initial=0) + 0.5)  # sublattices of a row
    group = row * apart + np.floor(lattice.sites[:, 0]).astype(np.int64) % apart
    order = np.argsort(group, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(lattice.cells)
    first, second = rank[lattice.first], rank[lattice.second]
    ends = np.concatenate([first, second]), np.concatenate([second, first])
    return order, _layout(lattice, order, group, ends, precision)


def _row(lattice: Lattice) -> NDArray[np.int64]:
    """Number of the row in which each cell was cast."""
    changes = np.diff(lattice.sites[:, 1:], axis=0).any(axis=1)
    return np.concatenate([[0], np.cumsum(changes)])


def _layout(
    lattice: Lattice,
    order: NDArray[np.int64],
    group: NDArray[np.int64],
    ends: tuple[NDArray[Any], NDArray[Any]],
    precision: DTypeLike,
) -> Network:
    """Cut ordered cells into chunks where their group changes, and collect bonds into entries."""
    cell, other = ends
    number = np.arange(lattice.cells)
    opens_group = np.diff(group[order], prepend=-1) != 0
    lane = (number - np.maximum.accumulate(np.where(opens_group, number, 0))) % lanes(precision)
    chunk = np.cumsum(lane == 0) - 1
    first = np.flatnonzero(lane == 0)
    sites = lattice.sites[order]
    displacement = sites[other] - sites[cell]
    steps = np.rint(displacement * (2, 2, np.sqrt(2))).astype(np.int64) + 8  # half l0, and layers
    _, index, kind = np.unique(steps @ (256, 16, 1), return_index=True, return_inverse=True)
    rest = np.tile(lattice.rest_length, 2)[index]
    kinds = max(1, len(index))
    # One number for chunk, kind and second cell: much faster to sort than rows of three.
    span, reach = lattice.cells + lanes(precision), lanes(precision)
    keys = (chunk[cell] * kinds + kind) * span + (other - lane[cell] + reach)
    keys, entry = np.unique(keys, return_inverse=True)
    bits = np.zeros(len(keys), np.uint16)
    np.bitwise_or.at(bits, entry, (1 << lane[cell]).astype(np.uint16))
    owner, kind = np.divmod(keys // span, kinds)
    return Network(
        first=first.astype(np.int32),
        filled=np.diff(first, append=lattice.cells).astype(np.int32),
        entries=np.searchsorted(owner, np.arange(len(first) + 1)),
        second=(keys % span - reach).astype(np.int32),
        bits=bits,
        kind=kind.astype(np.int16),
        stiffness=np.tile(lattice.stiffness, 2)[index].astype(precision),
        rest_length=rest.astype(precision),
        direction=(displacement[index] / rest[:, None]).astype(precision),
    )
