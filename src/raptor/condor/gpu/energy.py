"""Energy and gradient of a batch; the formulas are those of `raptor.condor.energy` and `.walls`.

Bonds are seen from both their ends, so every cell sums its own forces: nothing is scattered, and the
order of every sum is fixed. A pass takes some directions at a time: few where cells are many, all in one
kernel where torch can compile it.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import torch
from torch import Tensor

from raptor.condor.energy import CONTACT_LENGTH, SOFTENING, natural_length
from raptor.condor.gpu.layout import BLOCK, Batch
from raptor.condor.walls import SPACING

AT_ONCE = 2**23  # bonds of a pass where it is not compiled: its temporaries stay below a GiB


class Terms(NamedTuple):
    """Sums over a cell's bonds, each (blocks, BLOCK).

    Twice the energy of the bonds and of the contacts, as each bond is met twice; the force; dE/ds.
    """

    energy: Tensor
    touching: Tensor
    force_x: Tensor
    force_y: Tensor
    force_z: Tensor
    turn_x: Tensor
    turn_y: Tensor
    turn_z: Tensor


class Objective(NamedTuple):
    """Energies of bonds, walls and contacts, (tissues,) float64; gradient (blocks, 6, BLOCK)."""

    energy: Tensor
    wall: Tensor
    touching: Tensor
    gradient: Tensor


def _bond_terms(
    flat: Tensor, own: Tensor, places: Tensor, addresses: Tensor, stiffness: Tensor, rest: Tensor,
    unit: Tensor, delta: Tensor, contact: Tensor,
) -> Terms:  # fmt: skip
    """Sums over some directions of bonds.

    `flat` is the unit state, `own` (6, blocks, BLOCK) the cells' and `places` their addresses, `addresses`
    (directions, blocks, BLOCK) of the other ends; a cell without one looks at itself, and at no other tissue;
    `stiffness` (directions, blocks, 1), `rest` and `unit` with a row a direction, `delta` and `contact`
    (blocks, 1).
    """
    there = addresses >= 0
    base = torch.where(there, addresses, places)
    x, y, z, ax, ay, az = own.unbind(0)
    lx = flat[base] - x
    ly = flat[base + BLOCK] - y
    lz = flat[base + 2 * BLOCK] - z
    bx, by, bz = flat[base + 3 * BLOCK], flat[base + 4 * BLOCK], flat[base + 5 * BLOCK]
    rest = rest[:, None, None]
    squared = lx * lx + ly * ly + lz * lz + SOFTENING
    inverse = torch.rsqrt(squared)
    ux, uy, uz = lx * inverse, ly * inverse, lz * inverse
    first = ux * ax + uy * ay + uz * az
    second = ux * bx + uy * by + uz * bz
    squares = first * first + second * second
    stretch = squared * inverse - natural_length(rest, delta, squares)
    tension = torch.where(there, stiffness, 0.0) * stretch
    twist = -delta * rest * tension
    turn = twist * inverse
    along = tension - turn * squares
    by_first, by_second = turn * first, turn * second
    dx, dy, dz = (unit[:, axis, None, None] for axis in range(3))
    push = (CONTACT_LENGTH * rest - (lx * dx + ly * dy + lz * dz)).clamp(min=0.0)
    pull = torch.where(there, contact, 0.0) * push
    return Terms(
        (0.5 * tension * stretch).sum(0),
        (0.5 * pull * push).sum(0),
        (along * ux + by_first * ax + by_second * bx - pull * dx).sum(0),
        (along * uy + by_first * ay + by_second * by - pull * dy).sum(0),
        (along * uz + by_first * az + by_second * bz - pull * dz).sum(0),
        (first * twist * ux).sum(0),
        (first * twist * uy).sum(0),
        (first * twist * uz).sum(0),
    )


@cache
def _compiled() -> Callable[..., Terms]:
    """All directions in one kernel."""
    return torch.compile(_bond_terms, dynamic=True)


def _all_bonds(batch: Batch, unit: Tensor, delta: Tensor, contact: Tensor) -> Terms:
    """Sums over all directions of bonds, for a unit state (blocks, 6, BLOCK)."""
    along = batch.directions
    kind = unit.dtype
    stiffness = batch.stiffness[along.shell].to(kind)[:, batch.owner, None]
    flat, own = unit.reshape(-1), unit.movedim(1, 0)
    step, terms = len(along.rest), _compiled() if unit.is_cuda else _bond_terms
    if not unit.is_cuda:
        step = max(1, AT_ONCE // max(1, own[0].numel()))
    passes = []
    for start in range(0, len(along.rest), step):
        some = slice(start, start + step)
        passes.append(
            terms(
                flat,
                own,
                batch.places,
                batch.neighbours[some],
                stiffness[some],
                along.rest[some].to(kind),
                along.unit[some].to(kind),
                batch.spread(delta.to(kind)),
                batch.spread(contact.to(kind)),
            )
        )
    if len(passes) == 1:
        return passes[0]
    return Terms(*(torch.stack(parts).sum(0) for parts in zip(*passes, strict=True)))


def units(state: Tensor) -> tuple[Tensor, Tensor]:
    """The state with orientations of length one, and their lengths (blocks, 1, BLOCK)."""
    length = torch.linalg.vector_norm(state[:, 3:], dim=1, keepdim=True)
    return torch.cat([state[:, :3], state[:, 3:] / length], dim=1), length


def objective(batch: Batch, state: Tensor, delta: Tensor, contact: Tensor) -> Objective:
    """Energies and gradient of a state, as `raptor.condor.energy.objective`.

    Parameters
    ----------
    state : Tensor (blocks, 6, BLOCK)
        Positions (l0) and vectors along orientations; all is computed in their precision.
    delta, contact : Tensor (tissues,)
        Cell-matrix interaction, and stiffness of contacts (kappa0), of each tissue.
    """
    unit, length = units(state)
    terms = _all_bonds(batch, unit, delta, contact)
    wall, wall_x, wall_y, wall_z = wall_terms(
        batch, batch.owner[:, None], state[:, 0], state[:, 1], state[:, 2], batch.colour >= 0
    )
    turn = torch.stack([terms.turn_x, terms.turn_y, terms.turn_z], dim=1)
    # dE/ds of a unit vector, as seen by a vector of any length along it.
    turn = (turn - (turn * unit[:, 3:]).sum(1, keepdim=True) * unit[:, 3:]) / length
    gradient = torch.stack([wall_x - terms.force_x, wall_y - terms.force_y, wall_z - terms.force_z], dim=1)
    by_block = [part.sum(1, dtype=torch.float64) for part in (terms.energy, wall, terms.touching)]
    energy, walls, touching = batch.total(torch.stack(by_block, dim=1)).unbind(1)
    return Objective(0.5 * energy, walls, 0.5 * touching, torch.cat([gradient, turn], dim=1))


def wall_terms(
    batch: Batch, tissue: Tensor, x: Tensor, y: Tensor, z: Tensor, there: Tensor
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Wall energy of cells (kappa0 l0^2) and its gradient (kappa0 l0); zero where no cell is there.

    `tissue` names the tissue of each cell, in a shape that broadcasts to theirs.
    """
    corner = batch.corner[tissue]
    rows, columns = corner[..., 0].long(), corner[..., 1].long()
    u, v = (x - corner[..., 2]) / SPACING, (y - corner[..., 3]) / SPACING
    column = torch.minimum((u + 0.5).floor().long().clamp(min=1), columns - 2)
    row = torch.minimum((v + 0.5).floor().long().clamp(min=1), rows - 2)
    u, v = u - column, v - row
    along = (0.5 * (0.5 - u) ** 2, 0.75 - u * u, 0.5 * (0.5 + u) ** 2), (u - 0.5, -2.0 * u, u + 0.5)
    across = (0.5 * (0.5 - v) ** 2, 0.75 - v * v, 0.5 * (0.5 + v) ** 2), (v - 0.5, -2.0 * v, v + 0.5)
    depth = torch.zeros_like(x)
    slope_x, slope_y = torch.zeros_like(x), torch.zeros_like(x)
    for i in range(3):
        base = batch.start[tissue] + (row + i - 1) * columns + column - 1
        knots = [batch.depth[base + j] for j in range(3)]
        value = along[0][0] * knots[0] + along[0][1] * knots[1] + along[0][2] * knots[2]
        slope = along[1][0] * knots[0] + along[1][1] * knots[1] + along[1][2] * knots[2]
        depth = depth + across[0][i] * value
        slope_x = slope_x + across[0][i] * slope
        slope_y = slope_y + across[1][i] * value
    below = (-z).clamp(min=0.0) - (z - batch.height).clamp(min=0.0)
    inside = torch.where(there, depth.clamp(min=0.0), 0.0)
    below = torch.where(there, below, 0.0)
    push = batch.wall * inside
    energy = 0.5 * (push * inside + batch.wall * below * below)
    return energy, push * slope_x / SPACING, push * slope_y / SPACING, -batch.wall * below


def inverted_fraction(batch: Batch, state: Tensor) -> Tensor:
    """Share of each tissue's bonds whose direction has reversed since casting, (tissues,) float64."""
    flat, along = state.reshape(-1), batch.directions.unit.to(state.dtype)
    count = torch.zeros(batch.blocks, dtype=torch.int64, device=state.device)
    bonds = torch.zeros_like(count)
    stiff = batch.stiffness[:, batch.owner] > 0  # a bond of no stiffness is none
    for addresses, direction, shell in zip(batch.neighbours, along, batch.directions.shell, strict=True):
        base = torch.where(addresses >= 0, addresses, batch.places)
        moved = [(flat[base + axis * BLOCK] - state[:, axis]) * direction[axis] for axis in range(3)]
        ahead = moved[0] + moved[1] + moved[2]
        there = (addresses >= 0) & stiff[shell][:, None]
        count += (there & (ahead < 0)).sum(1)
        bonds += there.sum(1)
    totals = batch.total(torch.stack([count, bonds], dim=1).double())
    return totals[:, 0] / totals[:, 1].clamp(min=1)


def cell_tension(batch: Batch, state: Tensor, delta: Tensor, kind: str = "hooke") -> Tensor:
    """Mean tension of each cell's bonds, (blocks, BLOCK), as `raptor.condor.energy.cell_tension`."""
    unit = units(state)[0]
    flat, along = unit.reshape(-1), batch.directions
    d = batch.spread(delta.to(unit.dtype))
    total = torch.zeros_like(unit[:, 0])
    bonds = torch.zeros_like(total)
    for addresses, rest, shell in zip(batch.neighbours, along.rest, along.shell, strict=True):
        stiffness = batch.stiffness[shell].to(unit.dtype)[batch.owner][:, None]
        stiffness = torch.where(addresses >= 0, stiffness, 0.0)
        base = torch.where(addresses >= 0, addresses, batch.places)
        cell, other = unit.unbind(1), [flat[base + row * BLOCK] for row in range(6)]
        stretch = bond_stretch(cell, other, rest, d)
        if kind == "hooke":
            total += stiffness * stretch
        else:
            apart = [(other[axis] - cell[axis]) ** 2 for axis in range(3)]
            total += stiffness * ((apart[0] + apart[1] + apart[2] + SOFTENING).sqrt() - stretch)
        bonds += stiffness > 0
    return total / bonds.clamp(min=1)


def bond_stretch(cell: Sequence[Tensor], other: Sequence[Tensor], rest: Tensor, delta: Tensor) -> Tensor:
    """|l| - L' of bonds between two cells, each as x, y, z and its unit orientation."""
    lx, ly, lz = (other[axis] - cell[axis] for axis in range(3))
    squared = lx * lx + ly * ly + lz * lz + SOFTENING
    inverse = torch.rsqrt(squared)
    first = (lx * cell[3] + ly * cell[4] + lz * cell[5]) * inverse
    second = (lx * other[3] + ly * other[4] + lz * other[5]) * inverse
    squares = first * first + second * second
    natural: Tensor = natural_length(rest, delta, squares)
    return squared * inverse - natural
