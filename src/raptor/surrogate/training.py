"""Training of pix2pix: resumable, deterministic, the best weights kept."""

import logging
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from torch import Tensor, nn
from torch.utils.data import DataLoader

from raptor.dataset.examples import Example
from raptor.dataset.loader import ExampleSet
from raptor.dataset.scaling import INPUTS, Scaling
from raptor.errors import RaptorError
from raptor.files import atomic_path
from raptor.surrogate.losses import discriminator_loss, generator_loss
from raptor.surrogate.networks import Architecture, Discriminator, Generator, initialise
from raptor.symmetry import FIELDS

log = logging.getLogger(__name__)

SCORED = [FIELDS.index(field) for field in ("density", "sxsx", "sysy", "sxsy")]
"""Fields of the validation error: shape and alignment. The sign of sxsz and sysz is spontaneous, and
tension nearly cancels where nothing pulls, so their error says little of the network."""


@dataclass(frozen=True)
class TrainingRules:
    """How to train.

    Parameters
    ----------
    epochs, batch_size : int
        Passes over the examples, and examples a step.
    learning_rate, beta1 : float
        Of Adam, for both networks (2e-4 and 0.5 in pix2pix); the rate falls linearly to zero over
        the second half of the epochs.
    lambda_l1 : float
        Weight of the L1 term (100 in pix2pix).
    seed : int
        Of first weights, order of examples and dropout.
    threads : int
        Processor threads; trained weights are equal for an equal number.
    workers : int
        Processes that read examples ahead; weights do not depend on them.
    """

    epochs: int
    batch_size: int
    learning_rate: float
    beta1: float
    lambda_l1: float
    seed: int
    threads: int
    workers: int = 0


@dataclass
class _State:
    """Everything that training changes."""

    generator: Generator
    discriminator: Discriminator
    optimisers: tuple[torch.optim.Adam, torch.optim.Adam]
    history: list[dict[str, float]]
    best: dict[str, Tensor]

    def pack(self, identity: str) -> dict[str, Any]:
        return {
            "identity": identity,
            "generator": self.generator.state_dict(),
            "discriminator": self.discriminator.state_dict(),
            "optimisers": [optimiser.state_dict() for optimiser in self.optimisers],
            "history": self.history,
            "best": self.best,
        }

    def unpack(self, packed: dict[str, Any]) -> None:
        self.generator.load_state_dict(packed["generator"])
        self.discriminator.load_state_dict(packed["discriminator"])
        for optimiser, state in zip(self.optimisers, packed["optimisers"], strict=True):
            optimiser.load_state_dict(state)
        self.history, self.best = packed["history"], packed["best"]


@dataclass(frozen=True)
class Trained:
    """The best generator's weights, and one row an epoch."""

    weights: dict[str, Tensor]
    history: pd.DataFrame


def train(
    stack: Path,
    examples: list[Example],
    splits: list[str],
    scaling: Scaling,
    architecture: Architecture,
    rules: TrainingRules,
    checkpoint: Path,
    identity: str,
    progress: Callable[[int, dict[str, float]], None] = lambda epoch, row: None,
) -> Trained:
    """Train, or go on from the checkpoint if it is of the same training.

    Parameters
    ----------
    splits : list of str
        Split of each sample of the stack.
    identity : str
        Hash of everything the training hangs on; a checkpoint of another one is ignored.

    Raises
    ------
    RaptorError
        Where a split has no example, or the loss is no longer finite.
    """
    torch.set_num_threads(rules.threads)
    torch.use_deterministic_algorithms(True, warn_only=True)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    chosen = {
        name: ExampleSet(stack, [e for e in examples if splits[e.sample] == name], scaling)
        for name in ("train", "validation")
    }
    for name, dataset in chosen.items():
        if not len(dataset):
            raise RaptorError(f"there is no {name} example; raise design.simulations or design.{name}")
    state = _start(architecture, rules, device)
    _resume(state, checkpoint, identity, device)
    for epoch in range(len(state.history), rules.epochs):
        started = time.perf_counter()
        losses = _train_epoch(state, chosen["train"], rules, epoch, device)
        batches = DataLoader(chosen["validation"], rules.batch_size, num_workers=rules.workers)
        error = validation_error(state.generator, batches, device)
        row = {"epoch": epoch, **losses, "validation_error": error}
        row["seconds"] = time.perf_counter() - started
        if not np.isfinite(list(row.values())).all():
            raise RaptorError(
                f"training broke down in epoch {epoch} ({row}); lower surrogate.learning_rate and run again"
            )
        if not state.history or error < min(r["validation_error"] for r in state.history):
            state.best = {k: v.detach().cpu().clone() for k, v in state.generator.state_dict().items()}
        state.history.append(row)
        with atomic_path(checkpoint) as temporary:
            torch.save(state.pack(identity), temporary)
        log.info("%s", ", ".join(f"{key} {value:.4g}" for key, value in row.items()))
        progress(epoch, row)
    return Trained(state.best, pd.DataFrame(state.history))


def _start(architecture: Architecture, rules: TrainingRules, device: torch.device) -> _State:
    torch.manual_seed(rules.seed)
    generator, discriminator = Generator(architecture), Discriminator(architecture)
    networks: list[nn.Module] = [generator, discriminator]
    optimisers = tuple(
        torch.optim.Adam(
            initialise(network).to(device).parameters(), rules.learning_rate, (rules.beta1, 0.999)
        )
        for network in networks
    )
    return _State(generator, discriminator, (optimisers[0], optimisers[1]), [], {})


def _resume(state: _State, checkpoint: Path, identity: str, device: torch.device) -> None:
    if not checkpoint.is_file():
        return
    try:
        packed = torch.load(checkpoint, map_location=device, weights_only=True)
    except Exception as error:
        log.warning("checkpoint %s cannot be read (%s); training starts anew", checkpoint, error)
        return
    if packed["identity"] == identity:
        state.unpack(packed)
        log.info("resumed after epoch %d", len(state.history) - 1)


def _train_epoch(
    state: _State, dataset: ExampleSet, rules: TrainingRules, epoch: int, device: torch.device
) -> dict[str, float]:
    """One pass over the examples in an order of the epoch's own; returns mean losses."""
    torch.manual_seed(int(np.random.SeedSequence([rules.seed, epoch]).generate_state(1)[0]))
    order = torch.randperm(len(dataset)).tolist()
    if len(order) % rules.batch_size == 1 and len(order) > 1:
        order.pop()  # a batch of one has no statistics to normalise by
    rate = rules.learning_rate * min(1.0, 2 * (1 - epoch / rules.epochs))
    for optimiser in state.optimisers:
        for group in optimiser.param_groups:
            group["lr"] = rate
    state.generator.train()
    state.discriminator.train()
    sums = {"generator_loss": 0.0, "l1": 0.0, "discriminator_loss": 0.0}
    batches = 0
    for inputs, target in DataLoader(dataset, rules.batch_size, sampler=order, num_workers=rules.workers):
        losses = _step(state, inputs.to(device), target.to(device), rules.lambda_l1)
        sums = {key: value + losses[key] for key, value in sums.items()}
        batches += 1
    return {key: value / batches for key, value in sums.items()}


def _step(state: _State, inputs: Tensor, target: Tensor, lambda_l1: float) -> dict[str, float]:
    """One step of the discriminator, then one of the generator."""
    prediction = state.generator(inputs)
    state.optimisers[1].zero_grad(set_to_none=True)
    judged = discriminator_loss(
        state.discriminator(inputs, target), state.discriminator(inputs, prediction.detach())
    )
    judged.backward()  # type: ignore[no-untyped-call]
    state.optimisers[1].step()

    state.optimisers[0].zero_grad(set_to_none=True)
    state.discriminator.requires_grad_(False)
    loss = generator_loss(state.discriminator(inputs, prediction), prediction, target, lambda_l1)
    loss.total.backward()  # type: ignore[no-untyped-call]
    state.discriminator.requires_grad_(True)
    state.optimisers[0].step()
    return {
        "generator_loss": float(loss.total.detach()),
        "l1": float(loss.l1.detach()),
        "discriminator_loss": float(judged.detach()),
    }


def validation_error(
    generator: Generator, batches: Iterable[tuple[Tensor, Tensor]], device: torch.device
) -> float:
    """Mean over the fields `SCORED` of the VRMSE of all examples taken together.

    Error and variance are summed over the examples before they are divided: an example in which
    nothing happens, and whose own variance is next to nothing, does not drown the others.
    """
    generator.eval()
    error, variance = np.zeros(len(SCORED)), np.zeros(len(SCORED))
    with torch.no_grad():
        for inputs, target in batches:
            predicted = generator(inputs.to(device))[:, SCORED].cpu()
            wanted = target[:, SCORED]
            error += ((predicted - wanted) ** 2).mean(dim=(2, 3), dtype=torch.float64).sum(dim=0).numpy()
            variance += wanted.double().var(dim=(2, 3), correction=0).sum(dim=0).numpy()
    return float(np.sqrt(error / np.maximum(variance, 1e-12)).mean())


def samples_a_second(architecture: Architecture, rules: TrainingRules, steps: int = 3) -> float:
    """Examples a second that steps of training take, reading left out; for benchmarks."""
    torch.set_num_threads(rules.threads)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    state = _start(architecture, rules, device)
    shape = (rules.batch_size, architecture.pixels, architecture.pixels)
    inputs = torch.randn(shape[0], len(INPUTS), *shape[1:], device=device)
    target = torch.randn(shape[0], len(FIELDS), *shape[1:], device=device)
    _step(state, inputs, target, rules.lambda_l1)  # the first one also plans
    started = time.perf_counter()
    for _ in range(steps):
        _step(state, inputs, target, rules.lambda_l1)  # ends with its losses on the processor
    return steps * rules.batch_size / (time.perf_counter() - started)


def write_history(path: Path, history: pd.DataFrame) -> None:
    """Write one row an epoch as CSV."""
    with atomic_path(path) as temporary:
        history.to_csv(temporary, index=False)


def describe(architecture: Architecture, rules: TrainingRules) -> dict[str, Any]:
    """Architecture and rules, for model.json."""
    return {
        "architecture": architecture.as_json(),
        "training": asdict(rules),
        "torch": torch.__version__,
    }
