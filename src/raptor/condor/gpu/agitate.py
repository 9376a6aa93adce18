"""Metropolis sweeps of a batch: the agitation of `raptor.condor.anneal`, one colour of cells at a time.

Cells of a colour share no bond, so trying them together is equivalent to trying them one after another.
Each tissue has its own temperature, proposal size and random stream, so it does not depend on the others.
"""

import math

import torch
from torch import Tensor

from raptor.condor.anneal import (
    DRAWS,
    LARGEST_STEP,
    LARGEST_TURN,
    STIFFNESS_OF_A_CELL,
    TARGET_ACCEPTANCE,
    TURN_OVER_MOVE,
)
from raptor.condor.contract import COOLING, FOLDING, TURNING
from raptor.condor.energy import SMALLEST_LEVER
from raptor.condor.gpu.energy import bond_stretch, units, wall_terms
from raptor.condor.gpu.layout import BLOCK, ROW, Batch

_GOLDEN, _FIRST, _SECOND = (
    value - 2**64 for value in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
)


def uniform(key: Tensor, count: Tensor) -> Tensor:
    """Number `count` of stream `key` (int64), from 0 to 1, float32: SplitMix64, as in `condor.anneal`."""
    z = key + count * _GOLDEN
    z = (z ^ _shifted(z, 30)) * _FIRST
    z = (z ^ _shifted(z, 27)) * _SECOND
    # 24 bits, the precision of float32, so that 1 is never drawn
    return _shifted(z ^ _shifted(z, 31), 40).float() * 2.0**-24


def _shifted(z: Tensor, bits: int) -> Tensor:
    """Logical right shift; torch's own repeats the sign bit."""
    return (z >> bits) & ((1 << (64 - bits)) - 1)


def agitation_temperature(delta: Tensor) -> Tensor:
    """As `raptor.condor.contract.agitation_temperature`, for many tissues."""
    return torch.minimum(TURNING * delta**2, FOLDING * (1 - delta) ** 2)


def agitate(batch: Batch, state: Tensor, delta: Tensor, sweeps: int, key: Tensor) -> Tensor:
    """The state (blocks, 6, BLOCK) after a short anneal.

    Parameters
    ----------
    delta, key : Tensor (tissues,)
        Cell-matrix interaction, more than 0, and stream of random numbers (int64) of each tissue.
    sweeps : int
        Trial moves per cell.
    """
    flat = units(state)[0].reshape(-1).clone()
    colours = [_Colour(batch, number) for number in range(int(batch.colour.max()) + 1)]
    initial = agitation_temperature(delta)
    size = (initial / STIFFNESS_OF_A_CELL).sqrt().clamp(max=LARGEST_STEP)
    lever = delta.clamp(min=SMALLEST_LEVER)
    for sweep in range(sweeps):
        temperature = initial * COOLING ** (-sweep / max(1, sweeps - 1))
        turn = (TURN_OVER_MOVE * size / lever).clamp(max=LARGEST_TURN)
        accepted = torch.zeros(batch.tissues, dtype=torch.float64, device=flat.device)
        for colour in colours:
            accepted += colour.tries(flat, delta, temperature, size, turn, key, sweep)
        size = size * torch.exp(0.2 * (accepted / batch.cells - TARGET_ACCEPTANCE))
        size = size.clamp(max=LARGEST_STEP)
    return flat.reshape(state.shape)


class _Colour:
    """The cells of one colour, and their bonds."""

    def __init__(self, batch: Batch, number: int) -> None:
        self.batch = batch
        block, lane = torch.nonzero(batch.colour == number, as_tuple=True)
        self.cell = block * ROW + lane  # addresses
        self.tissue = batch.owner[block]
        first = torch.cumsum(batch.lengths, 0) - batch.lengths
        self.number = (block - first[self.tissue]) * BLOCK + lane  # in its tissue
        other = batch.neighbours[:, block, lane]
        self.base = torch.where(other >= 0, other, self.cell.to(torch.int32))
        self.stiffness = batch.stiffness.float()[batch.directions.shell][:, self.tissue]
        self.stiffness = torch.where(other >= 0, self.stiffness, 0.0)
        self.count = torch.bincount(self.tissue, minlength=batch.tissues)

    def tries(
        self, flat: Tensor, delta: Tensor, temperature: Tensor, size: Tensor, turn: Tensor, key: Tensor,
        sweep: int,
    ) -> Tensor:  # fmt: skip
        """Try each cell once, in place; returns the number accepted per tissue, (tissues,) float64."""
        batch, tissue = self.batch, self.tissue
        count = (sweep * batch.cells[tissue] + self.number) * DRAWS
        draws = [uniform(key[tissue], count + draw) for draw in range(DRAWS)]
        old = [flat[self.cell + row * BLOCK] for row in range(6)]
        new = _proposed(old, draws, size.float()[tissue], turn.float()[tissue])
        other = [flat[self.base + row * BLOCK] for row in range(6)]
        rest, d = batch.directions.rest.float()[:, None], delta.float()[tissue]
        before, after = (bond_stretch(cell, other, rest, d) for cell in (old, new))
        added = 0.5 * (self.stiffness * (after - before) * (after + before)).sum(0)
        there = torch.ones_like(tissue, dtype=torch.bool)
        walls = [wall_terms(batch, tissue, cell[0], cell[1], cell[2], there)[0] for cell in (old, new)]
        added += walls[1] - walls[0]
        chance = torch.exp(-added / temperature.float()[tissue])
        taken = draws[DRAWS - 1] < chance  # a chance above 1 is certain
        for row in range(6):
            flat[self.cell + row * BLOCK] = torch.where(taken, new[row], old[row])
        # Cells of a tissue are contiguous, in the order of tissues.
        return torch.segment_reduce(taken.double(), "sum", lengths=self.count, unsafe=True)


def _proposed(old: list[Tensor], draws: list[Tensor], size: Tensor, turn: Tensor) -> list[Tensor]:
    """New positions, uniform in a cube, and orientations, rotated isotropically."""
    moved = [old[axis] + size * (2.0 * draws[axis] - 1.0) for axis in range(3)]
    upright, angle = 2.0 * draws[3] - 1.0, 2.0 * math.pi * draws[4]
    length = turn * draws[5]
    flat = length * (1.0 - upright * upright).clamp(min=0.0).sqrt()
    turned = [old[3] + flat * angle.cos(), old[4] + flat * angle.sin(), old[5] + length * upright]
    norm = (turned[0] ** 2 + turned[1] ** 2 + turned[2] ** 2).sqrt()
    return moved + [component / norm for component in turned]
