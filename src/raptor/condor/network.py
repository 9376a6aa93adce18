"""The lattice's bonds laid out for the processor.

Cells are ordered by layer, row and column, so bonds of one direction mostly join consecutive cells
to consecutive cells. They are cut into chunks of `LANES`: bond t of a chunk joins cells
`first + t` and `second + t`, and a lane that holds no bond has no stiffness. A kernel copies
`CHUNKS` chunks into a small buffer with contiguous reads, evaluates all their bonds with vector
instructions, and adds the forces back, each bond once. The buffer stays in the innermost cache.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raptor.condor.lanes import LANES
from raptor.condor.lattice import Lattice

CHUNKS = 16  # chunks of a block
WIDTH = LANES * CHUNKS  # bonds of a block


class Network(NamedTuple):
    """Bonds in blocks of chunks, and the same bonds as a table of neighbours.

    Chunk c joins cells `chunk_first[c]` + t and `chunk_second[c]` + t with spring constants
    `stiffness[c * LANES + t]` (kappa0). Block b is chunks b * CHUNKS and following, of one rest length
    `block_rest[b]` (l0). The neighbours of cell i are entries `start[i]` to `start[i + 1]` of
    `neighbour`, `neighbour_stiffness` and `neighbour_rest`.
    """

    chunk_first: NDArray[np.int64]
    chunk_second: NDArray[np.int64]
    stiffness: NDArray[np.float64]
    block_rest: NDArray[np.float64]
    start: NDArray[np.int64]
    neighbour: NDArray[np.int32]
    neighbour_stiffness: NDArray[np.float64]
    neighbour_rest: NDArray[np.float64]


def build_network(lattice: Lattice) -> Network:
    """Lay out a lattice's bonds."""
    return Network(*_blocks(lattice), *_neighbours(lattice))


def _blocks(lattice: Lattice) -> tuple[NDArray[Any], ...]:
    """Chunks of consecutive bonds, filled up to whole blocks of one rest length."""
    parts = [
        _chunks(lattice, np.flatnonzero(lattice.rest_length == rest))
        for rest in np.unique(lattice.rest_length)
    ]
    empty: NDArray[np.int64] = np.empty(0, np.int64)
    return (
        np.concatenate([empty, *(part[0] for part in parts)]),
        np.concatenate([empty, *(part[1] for part in parts)]),
        np.concatenate([np.empty(0), *(part[2].ravel() for part in parts)]),
        np.repeat(np.unique(lattice.rest_length), [len(part[0]) // CHUNKS for part in parts]),
    )


def _chunks(lattice: Lattice, bonds: NDArray[np.int64]) -> tuple[NDArray[Any], ...]:
    """First cells, second cells and lane stiffness of the chunks that hold some bonds."""
    first = lattice.first[bonds].astype(np.int64)
    second = lattice.second[bonds].astype(np.int64)
    number = np.arange(len(bonds))
    opens_run = np.ones(len(bonds), dtype=bool)
    opens_run[1:] = (np.diff(first) != 1) | (np.diff(second) != 1)
    place = number - np.maximum.accumulate(np.where(opens_run, number, 0))
    lane = place % LANES
    chunk = np.cumsum(lane == 0) - 1
    opens_chunk = lane == 0
    count = -(-int(opens_chunk.sum()) // CHUNKS) * CHUNKS
    chunk_first, chunk_second = np.zeros(count, np.int64), np.zeros(count, np.int64)
    chunk_first[: chunk[-1] + 1] = first[opens_chunk]
    chunk_second[: chunk[-1] + 1] = second[opens_chunk]
    stiffness = np.zeros((count, LANES))
    stiffness[chunk, lane] = lattice.stiffness[bonds]
    return chunk_first, chunk_second, stiffness


def _neighbours(lattice: Lattice) -> tuple[NDArray[Any], ...]:
    cell = np.concatenate([lattice.first, lattice.second])
    other = np.concatenate([lattice.second, lattice.first])
    order = np.lexsort((other, cell))
    start = np.zeros(lattice.cells + 1, dtype=np.int64)
    start[1:] = np.cumsum(np.bincount(cell, minlength=lattice.cells))
    return (
        start,
        other[order].astype(np.int32),
        np.tile(lattice.stiffness, 2)[order],
        np.tile(lattice.rest_length, 2)[order],
    )
