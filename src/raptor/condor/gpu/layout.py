"""Many tissues in one batch: cells in blocks, bonds as tables of addresses.

Cells are kept in blocks of `BLOCK`, each of one tissue; the last block of a tissue is filled up with
cells that have no bonds and do not move. A state is (blocks, 6, BLOCK): x, y, z and a vector along the
orientation. Number `block * 6 * BLOCK + lane` is the **address** of a cell's x in the flat state; its
other components lie BLOCK, 2 BLOCK, ... further. A lattice has the same directions of bonds everywhere,
so bonds are one table of addresses a direction, with -1 where there is no cell.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from raptor.condor.lattice import shell_offsets, site_numbers
from raptor.condor.walls import Walls, build_walls
from raptor.moulds.cast import HALF_SPAN, cast_sites
from raptor.moulds.geometry import Mould
from raptor.parameters import SHELL_DISTANCE, CellParameters, NetworkModel

BLOCK = 128
ROW = 6 * BLOCK  # numbers of a block


@dataclass(frozen=True)
class Cast:
    """A mould's sites (cells, 3) and walls, made once on the processor."""

    sites: NDArray[np.float64]
    walls: Walls

    @property
    def blocks(self) -> int:
        """Blocks that its cells fill."""
        return -(-len(self.sites) // BLOCK)


def cast(mould: Mould, model: NetworkModel) -> Cast:
    """Cast a mould for a batch.

    Raises
    ------
    RaptorError
        If the mould holds no cell.
    """
    return Cast(cast_sites(mould, model.layers), build_walls(mould, model.height))


@dataclass(frozen=True)
class Directions:
    """The directions of bonds that a model has, each with its opposite.

    Parameters
    ----------
    offsets : ndarray (directions, 3)
        Steps to the second cell, in half l0, half l0 and layers.
    shell : Tensor (directions,)
        0, 1 or 2: which spring constant.
    rest : Tensor (directions,)
        Rest length, l0, float64.
    unit : Tensor (directions, 3)
        Direction at casting, float64.
    """

    offsets: NDArray[np.int64]
    shell: Tensor
    rest: Tensor
    unit: Tensor


def directions(model: NetworkModel, device: torch.device) -> Directions:
    """Every direction of a model's bonds, from both ends."""
    half = [shell_offsets(SHELL_DISTANCE[shell]) for shell in model.shells]
    both = [np.concatenate([offsets, -offsets]) for offsets in half]
    offsets = np.concatenate(both)
    shell = np.repeat(np.arange(len(both)), [len(offsets) for offsets in both])
    rest = np.array([SHELL_DISTANCE[model.shells[s]] for s in shell])
    unit = offsets * (0.5, 0.5, np.sqrt(0.5)) / rest[:, None]
    return Directions(offsets, *(torch.tensor(values, device=device) for values in (shell, rest, unit)))


@dataclass(frozen=True)
class Batch:
    """Tissues in blocks; what does not change while they contract.

    Parameters
    ----------
    sites : Tensor (blocks, 3, BLOCK)
        Cast positions, l0; where a block has no cell, a point between floor and fill height.
    neighbours : Tensor (directions, blocks, BLOCK)
        Addresses of the cells at the other ends of bonds, int32, -1 where there is none.
    owner : Tensor (blocks,)
        The tissue of each block, ascending.
    lengths : Tensor (tissues,)
        Blocks of each tissue.
    cells : Tensor (tissues,)
        Cells of each tissue.
    colour : Tensor (blocks, BLOCK)
        Cells of one colour share no bond; -1 where there is no cell.
    stiffness : Tensor (3, tissues)
        Spring constants, kappa0, float64.
    depth, corner, start : Tensor (knots,), (tissues, 4), (tissues,)
        Tables of the walls one after another; rows, columns (as numbers) and origin of each; where each
        begins.
    height, wall : float
        Fill height, l0, and the walls' stiffness, kappa0.
    directions : Directions
        Of the bonds.
    """

    sites: Tensor
    neighbours: Tensor
    owner: Tensor
    lengths: Tensor
    cells: Tensor
    colour: Tensor
    stiffness: Tensor
    depth: Tensor
    corner: Tensor
    start: Tensor
    height: float
    wall: float
    directions: Directions

    @property
    def tissues(self) -> int:
        """Number of tissues."""
        return len(self.lengths)

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return len(self.owner)

    def spread(self, values: Tensor) -> Tensor:
        """Numbers of tissues (tissues,) at every block, (blocks, 1)."""
        return values[self.owner][:, None]

    def total(self, values: Tensor) -> Tensor:
        """Sum over the blocks of each tissue: (blocks, ...) to (tissues, ...), always in the same order."""
        # unsafe: the lengths are ours, and need not be looked at on the processor each time
        return torch.segment_reduce(values, "sum", lengths=self.lengths, axis=0, unsafe=True)

    def largest(self, values: Tensor) -> Tensor:
        """Largest over the blocks of each tissue, (blocks,) to (tissues,)."""
        return torch.segment_reduce(values, "max", lengths=self.lengths, axis=0, unsafe=True)

    @cached_property
    def places(self) -> Tensor:
        """Every cell's own address, (blocks, BLOCK), int32."""
        lanes = torch.arange(BLOCK, dtype=torch.int32, device=self.owner.device)
        blocks = torch.arange(self.blocks, dtype=torch.int32, device=self.owner.device)
        return blocks[:, None] * ROW + lanes

    def blocks_of(self, chosen: Tensor) -> Tensor:
        """Whether each block belongs to the tissues chosen by a mask (tissues,)."""
        return chosen[self.owner]

    def take(self, chosen: Tensor) -> "Batch":
        """The batch of the tissues chosen by a mask (tissues,), in their order."""
        keep = self.blocks_of(chosen)
        moved = (torch.cumsum(keep, 0) - 1).to(torch.int32)  # new place of each block
        old = self.neighbours[:, keep]
        block = torch.div(old.clamp(min=0), ROW, rounding_mode="floor")
        rank = torch.cumsum(chosen, 0) - 1
        knots = (self.corner[:, 0] * self.corner[:, 1]).long()
        start = torch.cumsum(knots[chosen], 0) - knots[chosen]
        return Batch(
            self.sites[keep],
            torch.where(old < 0, old, (moved[block] - block) * ROW + old),
            rank[self.owner[keep]],
            self.lengths[chosen],
            self.cells[chosen],
            self.colour[keep],
            self.stiffness[:, chosen],
            self.depth[torch.repeat_interleave(chosen, knots)],
            self.corner[chosen],
            start,
            self.height,
            self.wall,
            self.directions,
        )


def build_batch(
    casts: Sequence[Cast], parameters: Sequence[CellParameters], model: NetworkModel, device: torch.device
) -> Batch:
    """Lay out cast moulds for a device; all share the model, each has its own parameters."""
    along = directions(model, device)
    lengths = np.array([c.blocks for c in casts])
    before = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    blocks = int(lengths.sum())
    sites = np.full((blocks, 3, BLOCK), 1.0, np.float32)
    sites[:, 2] = 0.5 * model.height  # a filler stands still between floor and fill height
    neighbours = np.full((len(along.offsets), blocks * BLOCK), -1, np.int32)
    colour = np.full(blocks * BLOCK, -1, np.int8)
    for tissue, first in zip(casts, before, strict=True):
        n = len(tissue.sites)
        cell = first * BLOCK + np.arange(n)
        sites[first + np.arange(n) // BLOCK, :, np.arange(n) % BLOCK] = tissue.sites
        found = _neighbours(tissue.sites, model.layers, along.offsets)
        block, lane = np.divmod(first * BLOCK + found, BLOCK)
        neighbours[:, cell] = np.where(found < 0, -1, block * ROW + lane)
        colour[cell] = _colours(tissue.sites, model)
    tables = [np.asarray(c.walls.depth, np.float32) for c in casts]
    ends = np.cumsum([table.size for table in tables])
    corner = [(*c.walls.depth.shape, c.walls.x0, c.walls.y0) for c in casts]
    kappas = [(1.0, p.kappa_nnn, p.kappa_nnnn) for p in parameters]

    def put(values: object, kind: torch.dtype) -> Tensor:
        return torch.as_tensor(np.asarray(values), dtype=kind, device=device)

    return Batch(
        put(sites, torch.float32),
        put(neighbours.reshape(-1, blocks, BLOCK), torch.int32),
        put(np.repeat(np.arange(len(casts)), lengths), torch.int64),
        put(lengths, torch.int64),
        put([len(c.sites) for c in casts], torch.int64),
        put(colour.reshape(blocks, BLOCK), torch.int8),
        put(np.array(kappas).T, torch.float64),
        put(np.concatenate([table.ravel() for table in tables]), torch.float32),
        put(corner, torch.float32),
        put(np.concatenate([[0], ends[:-1]]), torch.int64),
        float(model.height),
        float(casts[0].walls.stiffness),
        along,
    )


def join(batches: Sequence[Batch]) -> Batch:
    """Several batches of one model as one, their tissues in order."""
    first_block = np.cumsum([0, *(b.blocks for b in batches)])
    first_tissue = np.cumsum([0, *(b.tissues for b in batches)])
    first_knot = np.cumsum([0, *(len(b.depth) for b in batches)])

    def cat(name: str, axis: int = 0, first: NDArray[np.int64] | None = None) -> Tensor:
        parts = [getattr(b, name) for b in batches]
        if first is not None:
            parts = [part + int(shift) for part, shift in zip(parts, first, strict=False)]
        return torch.cat(parts, dim=axis)

    moved = [
        torch.where(b.neighbours < 0, b.neighbours, b.neighbours + int(shift) * ROW)
        for b, shift in zip(batches, first_block, strict=False)
    ]
    model = batches[0]
    return Batch(
        cat("sites"), torch.cat(moved, dim=1), cat("owner", first=first_tissue), cat("lengths"),
        cat("cells"), cat("colour"), cat("stiffness", 1), cat("depth"), cat("corner"),
        cat("start", first=first_knot), model.height, model.wall, model.directions,
    )  # fmt: skip


def _neighbours(sites: NDArray[np.float64], layers: int, offsets: NDArray[np.int64]) -> NDArray[np.int64]:
    """The cell at the end of each bond, (directions, cells), -1 where there is none."""
    index = np.pad(site_numbers(sites, layers), 4, constant_values=-1)
    layer = np.rint(sites[:, 2] * np.sqrt(2) - 0.5).astype(int) + 4
    column, row = (np.rint(2 * sites[:, axis]).astype(int) + 2 * HALF_SPAN + 4 for axis in (0, 1))
    return np.stack([index[layer + dk, row + dy, column + dx] for dx, dy, dk in offsets]).astype(np.int64)


def _colours(sites: NDArray[np.float64], model: NetworkModel) -> NDArray[np.int8]:
    """A colour for each cell: two cells of one colour are farther apart than any bond is long.

    They repeat after 2 l0 in the plane and 4 layers (3 l0 and 6 layers where bonds are 2 l0 long).
    """
    side = 6 if max(SHELL_DISTANCE[shell] for shell in model.shells) >= 2 else 4
    steps = np.rint(sites * (2, 2, np.sqrt(2)) - (0, 0, 0.5)).astype(int) % side
    code = steps @ (side * side, side, 1)
    return np.unique(code, return_inverse=True)[1].astype(np.int8)
