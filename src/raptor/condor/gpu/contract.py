"""The contraction of many tissues, as in `raptor.condor.contract`; finished tissues are replaced by others.

Each tissue steps at its own pace. Those that have finished a step are agitated together and continue; those
that have finished all steps leave the batch, and others from the queue take their place.
"""

import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, fields
from itertools import count

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from raptor.condor.accuracy import Accuracy, accuracy_named
from raptor.condor.contract import CONTACT, steps_to
from raptor.condor.gpu.agitate import agitate
from raptor.condor.gpu.energy import cell_tension, inverted_fraction, objective, units
from raptor.condor.gpu.layout import BLOCK, Batch, Cast, build_batch
from raptor.condor.gpu.minimise import Goal, Minimiser
from raptor.condor.simulate import Tissue, undrifted
from raptor.condor.system import cast_state
from raptor.core.errors import RaptorError
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters, NetworkModel

TOGETHER = 0.25  # share of the tissues that must have finished a step before they continue
PATIENCE = 100  # evaluations after which those that have finished continue anyway
LOOK = 5  # evaluations between checks, for which a GPU must synchronise
BYTES_A_CELL = 2000  # measured: up to 1,750, for neighbours, pairs, states, and copies while a batch changes
PHASES = 3  # of a step: minimised; with contacts from there; with contacts from where the step began


@dataclass(frozen=True)
class Task:
    """A tissue to be simulated: its mould, and that mould cast; its parameters and seed."""

    mould: Mould
    cast: Cast
    parameters: CellParameters
    seed: int


@dataclass
class _Progress:
    """How far each tissue of a batch is, (tissues,) each.

    Its number among the tasks, the step of its contraction, the phase of the step, and the evaluations
    of the minimisations that it has behind it.
    """

    task: NDArray[np.int64]
    step: NDArray[np.int64]
    phase: NDArray[np.int64]
    used: NDArray[np.int64]

    @classmethod
    def fresh(cls, numbers: list[int]) -> "_Progress":
        return cls(np.array(numbers, np.int64), *(np.zeros(len(numbers), np.int64) for _ in range(3)))

    def take(self, chosen: NDArray[np.bool_]) -> "_Progress":
        return _Progress(*(getattr(self, f.name)[chosen] for f in fields(self)))

    def join(self, other: "_Progress") -> "_Progress":
        both = [[getattr(part, f.name) for part in (self, other)] for f in fields(self)]
        return _Progress(*(np.concatenate(pair) for pair in both))


def room_for_cells(device: torch.device) -> int:
    """Cells that a batch may hold: two thirds of a GPU's free memory; few on a processor, for its caches."""
    if device.type != "cuda":
        return 50_000
    free, _ = torch.cuda.mem_get_info(device)
    return int(free / 1.5 / BYTES_A_CELL)


class BatchSolver:
    """Contracts tissues on a device, as many at once as there is room for.

    Raises
    ------
    RaptorError
        If the accuracy is not one that contracts alone: draft or standard.
    """

    def __init__(
        self,
        tasks: list[Task],
        model: NetworkModel,
        accuracy: str,
        device: torch.device,
        cells: int | None = None,
    ) -> None:
        self.tasks, self.model, self.device = tasks, model, device
        self.accuracy = _batched(accuracy)
        self.blocks = -(-(room_for_cells(device) if cells is None else cells) // BLOCK)
        shortening = self.accuracy.contraction.shortening
        self.targets = [steps_to(task.parameters.delta, shortening) for task in tasks]
        # Large tissues first, so that those that come last are small.
        self.queue = deque(sorted(range(len(tasks)), key=lambda n: (-tasks[n].cast.blocks, n)))
        self.keys: dict[int, NDArray[np.uint64]] = {}  # of each step's agitation
        self.minimiser: Minimiser | None = None
        self.progress = _Progress.fresh([])
        self.began = torch.empty(0)  # states in which tissues began their present steps
        self.evaluated = 0  # cells times evaluations

    def run(self) -> Iterator[tuple[int, Tissue]]:
        """Contract all tasks; gives number and simulation of each as it finishes."""
        started = time.perf_counter()
        while self.queue or self.minimiser is not None:
            self._take_in()
            retired = self._go_on(self._minimise())
            if retired.any():
                seconds = (time.perf_counter() - started) / max(1, self.evaluated)
                yield from self._finish(retired, seconds)
                self._drop(retired)

    def _take_in(self) -> None:
        """Fill the room that is left by tissues from the queue."""
        filled, chosen = 0 if self.minimiser is None else self.minimiser.batch.blocks, []
        while self.queue:
            more = self.tasks[self.queue[0]].cast.blocks
            if filled and filled + more > self.blocks:
                break
            chosen.append(self.queue.popleft())
            filled += more
        if not chosen:
            return
        tasks = [self.tasks[number] for number in chosen]
        batch = build_batch([t.cast for t in tasks], [t.parameters for t in tasks], self.model, self.device)
        state = self._cast(chosen, batch)
        added = Minimiser(batch, state, self._goal([0.0] * len(chosen)))
        if self.minimiser is None:
            self.minimiser, self.progress, self.began = added, _Progress.fresh(chosen), state
        else:
            self.minimiser = self.minimiser.join(added)
            self.progress = self.progress.join(_Progress.fresh(chosen))
            self.began = torch.cat([self.began, state])
        self._begin(np.isin(self.progress.task, chosen))

    def _cast(self, chosen: list[int], batch: Batch) -> Tensor:
        """States (blocks, 6, BLOCK) at casting, as for one tissue; a filler's orientation is along x."""
        state = np.zeros((batch.blocks * BLOCK, 6), np.float32)
        state[:, :3] = batch.sites.movedim(1, 2).reshape(-1, 3).cpu().numpy()
        state[:, 3] = 1.0
        first = 0
        for number in chosen:
            task, rng = self.tasks[number], np.random.default_rng(self.tasks[number].seed)
            n = len(task.cast.sites)
            state[first : first + n] = cast_state(task.cast.sites, rng).reshape(6, n).T
            self.keys[number] = rng.integers(2**64, size=len(self.targets[number]), dtype=np.uint64)
            first += task.cast.blocks * BLOCK
        blocks = state.reshape(-1, BLOCK, 6).transpose(0, 2, 1)
        return torch.tensor(np.ascontiguousarray(blocks), device=self.device)

    def _goal(self, delta: list[float]) -> Goal:
        """Goals of minimisations to these Delta, none of them the last of its tissue."""
        rules, count = self.accuracy.contraction, len(delta)

        def each(value: float | list[float], kind: torch.dtype = torch.float64) -> Tensor:
            values = torch.tensor(value, dtype=kind, device=self.device)
            return values.expand(count).clone()

        return Goal(
            each(delta),
            each(0.0),
            each(rules.tolerance),
            each(rules.ftol),
            each(False, torch.bool),
            each(rules.max_evaluations, torch.int64),
        )

    def _begin(self, chosen: NDArray[np.bool_], contact: float = 0.0) -> None:
        """Begin the present phase of the tissues chosen by a mask; its first is agitated."""
        minimiser, progress, goal = self._busy(), self.progress, self._busy().goal
        mask, rows = self._mask(chosen), torch.tensor(np.flatnonzero(chosen), device=self.device)
        ahead = [
            self.targets[n][k] for n, k in zip(progress.task[chosen], progress.step[chosen], strict=True)
        ]
        last = [len(self.targets[n]) - 1 == k for n, k in zip(progress.task, progress.step, strict=True)]
        goal.delta[rows] = torch.tensor(ahead, dtype=torch.float64, device=self.device)
        goal.contact[rows] = contact
        rules = self.accuracy.contraction
        for values, at_last, before in (
            (goal.thorough, rules.last_ftol >= 0, False),
            (goal.tolerance, rules.tolerance, 0.0),
            (goal.ftol, rules.last_ftol, rules.ftol),
            (goal.max_evaluations, rules.max_evaluations, rules.step_evaluations),
        ):
            values[rows] = torch.tensor(
                [at_last if ends else before for ends, begins in zip(last, chosen, strict=True) if begins],
                dtype=values.dtype,
                device=self.device,
            )
        shaken = chosen & (progress.phase == 0) & (goal.delta > 0).cpu().numpy()
        if self.accuracy.contraction.sweeps and shaken.any():
            self._agitate(shaken)
        minimiser.start(mask)

    def _agitate(self, chosen: NDArray[np.bool_]) -> None:
        """Agitate the tissues chosen by a mask at their present Delta."""
        minimiser, mask = self._busy(), self._mask(chosen)
        here = minimiser.batch.blocks_of(mask)
        numbers = zip(self.progress.task[chosen], self.progress.step[chosen], strict=True)
        keys = np.array([self.keys[n][k] for n, k in numbers], np.uint64).astype(np.int64)
        minimiser.state[here] = agitate(
            minimiser.batch.take(mask),
            minimiser.state[here],
            minimiser.goal.delta[mask],
            self.accuracy.contraction.sweeps,
            torch.tensor(keys, device=self.device),
        )

    def _minimise(self) -> NDArray[np.bool_]:
        """Minimise until some tissues have finished their steps; returns which."""
        minimiser = self._busy()
        enough = max(1, int(TOGETHER * minimiser.batch.tissues))
        for evaluation in count():
            if evaluation % LOOK == 0:
                idle = int((~minimiser.busy).sum())
                if idle >= enough or (idle and evaluation >= PATIENCE):
                    break
                self.evaluated += LOOK * int((minimiser.busy * minimiser.batch.cells).sum())
            minimiser.step()
        return np.asarray((~minimiser.busy).cpu().numpy())

    def _go_on(self, idle: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Begin the next phase or step of the tissues that have finished one; returns who has none."""
        minimiser, progress = self._busy(), self.progress
        progress.used[idle] += minimiser.used.cpu().numpy()[idle]
        inverted = np.zeros_like(idle)
        if self.accuracy.contraction.shortening < 1:
            share = inverted_fraction(minimiser.batch, minimiser.state).cpu().numpy()
            inverted = idle & (share > 0) & (progress.phase < PHASES - 1)
        through = np.array([len(self.targets[n]) - 1 for n in progress.task]) == progress.step
        retired, onward = idle & ~inverted & through, idle & ~inverted & ~through
        progress.phase[inverted] += 1
        progress.phase[onward] = 0
        progress.step[onward] += 1
        back = self._mask(inverted & (progress.phase == PHASES - 1))
        minimiser.state = torch.where(self._at(back), self.began, minimiser.state)
        self.began = torch.where(self._at(self._mask(onward)), units(minimiser.state)[0], self.began)
        if inverted.any():
            self._begin(inverted, CONTACT)
        if onward.any():
            self._begin(onward)
        return np.asarray(retired)

    def _finish(self, retired: NDArray[np.bool_], seconds: float) -> Iterator[tuple[int, Tissue]]:
        """Simulations of the tissues that retire; `seconds` is what an evaluation of a cell takes."""
        part, progress = self._busy().take(self._mask(retired)), self.progress.take(retired)
        batch, goal = part.batch, part.goal
        # As they will be stored, but seen in double precision: who computes them again finds the same.
        state = units(units(part.state)[0].double())[0]
        found = objective(batch, state, goal.delta, goal.contact)
        tension = cell_tension(batch, state, goal.delta, self.model.tension).cpu().numpy().ravel()
        cells = state.movedim(1, 2).reshape(-1, 6).double().cpu().numpy()
        inverted = inverted_fraction(batch, state).tolist()
        reported = (found.energy, found.wall, found.touching, part.residual_gradient)
        energies = [values.tolist() for values in reported]
        small = (part.residual_gradient <= goal.tolerance * goal.lever).tolist()
        first = 0
        for row, number in enumerate(progress.task.tolist()):
            task = self.tasks[number]
            n, used = len(task.cast.sites), int(progress.used[row])
            moved, pull = cells[first : first + n], tension[first : first + n].astype(np.float64)
            first += task.cast.blocks * BLOCK
            blocks = np.concatenate([moved[:, :3].T.ravel(), moved[:, 3:].T.ravel()])
            if not task.mould.tethers:
                blocks = undrifted(blocks, task.cast.sites, task.mould)
            energy, wall, touching, residual = (values[row] for values in energies)
            finite = bool(np.isfinite(blocks).all() and np.isfinite(energy))
            yield (
                number,
                Tissue(
                    mould=task.mould,
                    parameters=task.parameters,
                    model=self.model,
                    accuracy=self.accuracy.name,
                    seed=task.seed,
                    sites=task.cast.sites,
                    positions=blocks[: 3 * n].reshape(3, -1).T.copy(),
                    orientation=blocks[3 * n :].reshape(3, -1).T.copy(),
                    tension=pull,
                    energy=energy,
                    wall_energy=wall,
                    contact_energy=touching,
                    residual_gradient=residual,
                    converged=finite and small[row],
                    inverted_fraction=inverted[row],
                    gradient_evaluations=used,
                    sweeps=len(self.targets[number]) * self.accuracy.contraction.sweeps,
                    wall_time=seconds * used * n,
                ),
            )

    def _drop(self, retired: NDArray[np.bool_]) -> None:
        """Go on without the tissues that retire."""
        left = self._mask(~retired)
        self.began = self.began[self._busy().batch.blocks_of(left)]
        self.progress = self.progress.take(~retired)
        self.minimiser = None if retired.all() else self._busy().take(left)

    def _busy(self) -> Minimiser:
        assert self.minimiser is not None, "no tissue is being minimised"
        return self.minimiser

    def _mask(self, chosen: NDArray[np.bool_]) -> Tensor:
        return torch.tensor(chosen, device=self.device)

    def _at(self, chosen: Tensor) -> Tensor:
        return self._busy().batch.blocks_of(chosen)[:, None, None]


def _batched(name: str) -> Accuracy:
    """An accuracy whose solver contracts and does no more."""
    accuracy = accuracy_named(name)
    if not accuracy.contracts_alone:
        raise RaptorError(
            f"accuracy is '{name}'; tissues are contracted in batches at draft or standard; choose "
            "one of these, or device: cpu"
        )
    return accuracy
