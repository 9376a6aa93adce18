"""Limited-memory BFGS of many tissues in lockstep: one evaluation of the whole batch at a time.

The algorithm is that of `raptor.condor.minimise`, tissue by tissue: two loops on the dot products of the
stored pairs, bounded steps, Armijo's condition with a parabola. Each tissue has its own step length, memory
and stopping test; a tissue whose step is rejected tries again while the others continue.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from raptor.condor.energy import SMALLEST_LEVER
from raptor.condor.gpu.energy import objective, units
from raptor.condor.gpu.layout import ROW, Batch, join
from raptor.condor.minimise import BACKTRACKS, MAX_STEP, MAX_TURN, MEMORY, SMALL_ENERGY, SUFFICIENT, WINDOW

TINY = 1e-30
PER_BLOCK = ("state", "gradient", "direction", "pairs")  # of a minimiser; its other tensors are per tissue


@dataclass
class Goal:
    """The goal of each tissue's minimisation; tensors (tissues,).

    Parameters
    ----------
    delta, contact : Tensor
        Cell-matrix interaction, and stiffness of contacts, kappa0.
    tolerance : Tensor
        Largest component of the gradient, kappa0 l0 times the orientations' lever.
    ftol : Tensor
        Fraction by which `WINDOW` evaluations must lower the energy; ignored if less than zero.
    thorough : Tensor
        Whether both conditions must be met, instead of one.
    max_evaluations : Tensor
        Largest number of evaluations.
    """

    delta: Tensor
    contact: Tensor
    tolerance: Tensor
    ftol: Tensor
    thorough: Tensor
    max_evaluations: Tensor

    @property
    def lever(self) -> Tensor:
        """Length of the vectors that represent orientations, l0."""
        return self.delta.clamp(min=SMALLEST_LEVER)


class Minimiser:
    """Minimises a batch in lockstep. States are (blocks, 6, BLOCK), numbers of tissues (tissues,).

    `state`, `energy`, `wall_energy` (contacts included), `residual_gradient` (its largest component) and
    `used` (evaluations) are the tissues' current values; `busy` says which are still being minimised.
    """

    def __init__(self, batch: Batch, state: Tensor, goal: Goal) -> None:
        self.batch, self.goal, self.state = batch, goal, state.clone()
        tissues, device = batch.tissues, state.device
        self.gradient = torch.zeros_like(state)
        self.direction = torch.zeros_like(state)
        # A ring of MEMORY steps, then one of as many changes of the gradient; their products with each
        # other and with the gradient; which of them are held, and the newest.
        self.pairs = torch.zeros(batch.blocks, 2 * MEMORY, ROW, device=device)
        self.products = torch.zeros(tissues, 2 * MEMORY, 2 * MEMORY, dtype=torch.float64, device=device)
        self.slanted = torch.zeros(tissues, 2 * MEMORY, dtype=torch.float64, device=device)
        self.held = torch.zeros(tissues, MEMORY, dtype=torch.bool, device=device)
        self.newest = torch.zeros(tissues, dtype=torch.int64, device=device)

        def zeros(kind: torch.dtype = torch.float64) -> Tensor:
            return torch.zeros(tissues, dtype=kind, device=device)

        self.energy, self.wall_energy, self.residual_gradient = zeros(), zeros(), zeros()
        self.slope, self.length, self.looked_at = zeros(), zeros(), zeros()
        self.used, self.looked, self.tries = (zeros(torch.int64) for _ in range(3))
        self.calm, self.busy = zeros(torch.bool), zeros(torch.bool)

    def take(self, chosen: Tensor) -> "Minimiser":
        """The minimisation of the tissues selected by a mask, in its current state."""
        batch = self.batch.take(chosen)
        keep = self.batch.blocks_of(chosen)
        goal = Goal(**{name: value[chosen] for name, value in vars(self.goal).items()})
        made = Minimiser(batch, self.state[keep], goal)
        for name, value in vars(self).items():
            if isinstance(value, Tensor):
                setattr(made, name, value[keep if name in PER_BLOCK else chosen])
        return made

    def join(self, other: "Minimiser") -> "Minimiser":
        """Two minimisations merged, both in their current state."""
        pairs = [(name, value, getattr(other.goal, name)) for name, value in vars(self.goal).items()]
        goal = Goal(**{name: torch.cat(both) for name, *both in pairs})
        made = Minimiser(join([self.batch, other.batch]), torch.cat([self.state, other.state]), goal)
        for name, value in vars(self).items():
            if isinstance(value, Tensor):
                setattr(made, name, torch.cat([value, getattr(other, name)]))
        return made

    def start(self, chosen: Tensor) -> None:
        """Restart from the current state, for the tissues selected by a mask, with their current goal."""
        batch, goal = self.batch, self.goal
        here = batch.blocks_of(chosen)[:, None, None]
        unit, _ = units(self.state)
        lever = batch.spread(goal.lever.float())[:, :, None]
        scaled = torch.cat([unit[:, :3], unit[:, 3:] * lever], dim=1)
        self.state = torch.where(here, scaled, self.state)
        found = objective(batch, self.state, goal.delta, goal.contact)
        wall_energy = found.wall + found.touching
        self.gradient = torch.where(here, found.gradient, self.gradient)
        self.energy = torch.where(chosen, found.energy, self.energy)
        self.wall_energy = torch.where(chosen, wall_energy, self.wall_energy)
        self.used = torch.where(chosen, 1, self.used)
        self.tries = torch.where(chosen, 0, self.tries)
        self.looked = torch.where(chosen, 1, self.looked)
        self.looked_at = torch.where(chosen, found.energy + wall_energy, self.looked_at)
        self.calm &= ~chosen
        self.held &= ~chosen[:, None]
        self.busy |= chosen
        self._judge(chosen)
        self._aim(chosen)

    def step(self) -> None:
        """One evaluation of every busy tissue."""
        batch, goal = self.batch, self.goal
        trial = torch.add(self.state, batch.spread(self.length.float())[:, :, None] * self.direction)
        found = objective(batch, trial, goal.delta, goal.contact)
        wall_energy = found.wall + found.touching
        total, before = found.energy + wall_energy, self.energy + self.wall_energy
        self.used += self.busy
        taken = self.busy & (total <= before + SUFFICIENT * self.length * self.slope)
        self._keep(taken, trial, found.gradient)
        self.energy = torch.where(taken, found.energy, self.energy)
        self.wall_energy = torch.where(taken, wall_energy, self.wall_energy)
        refused = self.busy & ~taken
        self.tries = torch.where(refused, self.tries + 1, 0)
        # The minimum of the parabola through the known values, within bounds.
        curve = total - before - self.length * self.slope
        best = -0.5 * self.slope * self.length**2 / curve.clamp(min=TINY)
        best = torch.minimum(torch.maximum(best, 0.1 * self.length), 0.5 * self.length)
        self.length = torch.where(
            refused, torch.where(total.isfinite(), best, 0.1 * self.length), self.length
        )
        lost = refused & (self.tries >= BACKTRACKS)
        self.busy &= ~(lost & ~self.held.any(1))  # as low as rounding allows
        self.held &= ~lost[:, None]
        self.tries = torch.where(lost, 0, self.tries)
        self._judge(taken)
        self._aim((taken | lost) & self.busy)

    def _judge(self, moved: Tensor) -> None:
        """Which tissues have reached their goal, among those whose state has changed."""
        goal, total = self.goal, self.energy + self.wall_energy
        look = moved & (self.used - self.looked >= WINDOW)
        small = SMALL_ENERGY * goal.lever**2 * self.batch.cells
        calm = self.looked_at - total <= goal.ftol * torch.maximum(total, small)
        self.calm = torch.where(look, calm, self.calm)
        self.looked = torch.where(look, self.used, self.looked)
        self.looked_at = torch.where(look, total, self.looked_at)
        move, turn = self._largest(self.gradient, by_orientation=True)
        self.residual_gradient = torch.where(
            moved, torch.maximum(move, turn / goal.lever), self.residual_gradient
        )
        small = self.residual_gradient <= goal.tolerance * goal.lever
        done = torch.where(goal.thorough, small & self.calm, small | self.calm)
        self.busy &= ~(done & moved) & (self.used < goal.max_evaluations)

    def _largest(self, vector: Tensor, by_orientation: bool = False) -> tuple[Tensor, Tensor]:
        """Largest component by position, and by orientation (as for unit vectors), (tissues,) float64."""
        turn = vector[:, 3:].abs()
        if by_orientation:
            turn = turn * torch.linalg.vector_norm(self.state[:, 3:], dim=1, keepdim=True)
        parts = torch.stack([vector[:, :3].abs().amax((1, 2)), turn.amax((1, 2))])
        move, turned = (self.batch.largest(part).double() for part in parts)
        return move, turned

    def _keep(self, taken: Tensor, trial: Tensor, gradient: Tensor) -> None:
        """Accept the trial state where it qualifies, and store the step that led there."""
        batch = self.batch
        here = batch.blocks_of(taken)[:, None]
        self.newest = torch.where(taken, (self.newest + 1) % MEMORY, self.newest)
        place, block = self.newest[batch.owner], torch.arange(batch.blocks, device=trial.device)
        step = (trial - self.state).reshape(-1, ROW)
        change = (gradient - self.gradient).reshape(-1, ROW)
        for part, first in ((step, 0), (change, MEMORY)):
            self.pairs[block, first + place] = torch.where(here, part, self.pairs[block, first + place])
        self.state = torch.where(here[:, :, None], trial, self.state)
        self.gradient = torch.where(here[:, :, None], gradient, self.gradient)
        new = torch.stack([step, change, self.gradient.reshape(-1, ROW)], dim=2)
        dots = batch.total(torch.bmm(self.pairs, new).double())
        took = taken[:, None]
        self.slanted = torch.where(took, dots[:, :, 2], self.slanted)
        tissue = torch.arange(batch.tissues, device=trial.device)
        for column, first in ((dots[:, :, 0], 0), (dots[:, :, 1], MEMORY)):
            slot = first + self.newest
            self.products[tissue, :, slot] = torch.where(took, column, self.products[tissue, :, slot])
            self.products[tissue, slot] = torch.where(took, column, self.products[tissue, slot])
        sy, yy = dots[tissue, self.newest, 1], dots[tissue, MEMORY + self.newest, 1]
        held = self.held[tissue, self.newest]
        self.held[tissue, self.newest] = torch.where(taken, sy > 1e-10 * yy, held)

    def _aim(self, chosen: Tensor) -> None:
        """A new direction, its slope and an initial step length, for the selected tissues."""
        batch = self.batch
        factors, scale = self._two_loops()
        spread = factors.float()[batch.owner][:, None]
        direction = -batch.spread(scale.float())[:, :, None] * self.gradient
        direction -= torch.bmm(spread, self.pairs).reshape(self.state.shape)
        squares, slope = self._dots(direction)
        uphill = chosen & (slope >= 0)
        steep = batch.blocks_of(uphill)[:, None, None]
        direction = torch.where(steep, -self.gradient, direction)
        slope = torch.where(uphill, -squares, slope)
        self.held &= ~uphill[:, None]
        here = batch.blocks_of(chosen)[:, None, None]
        self.direction = torch.where(here, direction, self.direction)
        self.slope = torch.where(chosen, slope, self.slope)
        move, turn = self._largest(self.direction)
        turn = turn / self.goal.lever
        longest = torch.minimum(MAX_STEP / move.clamp(min=TINY), MAX_TURN / turn.clamp(min=TINY))
        first = torch.where(self.held.any(1), longest, 0.1 * longest).clamp(max=1.0)
        self.length = torch.where(chosen, first, self.length)

    def _dots(self, direction: Tensor) -> tuple[Tensor, Tensor]:
        """Gradient by gradient and gradient by direction, (tissues,) float64."""
        rows = self.gradient.reshape(-1, 1, ROW)
        with_both = torch.stack([self.gradient.reshape(-1, ROW), direction.reshape(-1, ROW)], dim=2)
        dots = self.batch.total(torch.bmm(rows, with_both)[:, 0].double())
        return dots[:, 0], dots[:, 1]

    def _two_loops(self) -> tuple[Tensor, Tensor]:
        """Factors of the pairs in - direction, (tissues, 2 MEMORY), and of the gradient, (tissues,).

        Empty places of the ring have factor zero.
        """
        back = torch.arange(MEMORY, device=self.newest.device)
        ring = (self.newest[:, None] - back) % MEMORY  # places from the newest to the oldest
        both = torch.cat([ring, ring + MEMORY], dim=1)
        wide = both[:, :, None].expand(-1, -1, 2 * MEMORY)
        products = self.products.gather(1, wide).gather(2, wide.transpose(1, 2))
        dots, held = self.slanted.gather(1, both), self.held.gather(1, ring)
        curvature = products[:, :MEMORY, MEMORY:].diagonal(dim1=1, dim2=2).clamp(min=TINY)
        size = products[:, MEMORY:, MEMORY:].diagonal(dim1=1, dim2=2).clamp(min=TINY)
        alpha = torch.zeros_like(curvature)
        scale = torch.ones_like(dots[:, 0])
        for p in range(MEMORY):
            along = dots[:, p] - (alpha * products[:, p, MEMORY:]).sum(1)
            alpha[:, p] = torch.where(held[:, p], along / curvature[:, p], 0.0)
        for p in reversed(range(MEMORY)):  # the newest pair held sets the scale
            scale = torch.where(held[:, p], curvature[:, p] / size[:, p], scale)
        factors = torch.zeros_like(dots)
        factors[:, MEMORY:] = -scale[:, None] * alpha
        for p in reversed(range(MEMORY)):
            along = scale * dots[:, MEMORY + p] + (factors * products[:, MEMORY + p]).sum(1)
            factors[:, p] = torch.where(held[:, p], alpha[:, p] - along / curvature[:, p], 0.0)
        return torch.zeros_like(factors).scatter(1, both, factors), scale
