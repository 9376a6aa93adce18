"""Training of one network: resumable and reproducible; keeps the best weights."""

import logging
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path
from raptor.surrogate.batches import ExampleSet, keep_if_they_fit
from raptor.surrogate.generator import Generator
from raptor.surrogate.learner import LOSSES, Learner, cells_of
from raptor.surrogate.losses import almost_fair_score
from raptor.surrogate.rules import Architecture, TrainingRules
from raptor.symmetry import FIELDS

log = logging.getLogger(__name__)

SCORED = [FIELDS.index(field) for field in ("density", "sxsx", "sysy", "sxsy")]
"""Fields of the validation error: shape and alignment. The sign of sxsz and sysz is spontaneous, and tension
nearly cancels where nothing pulls, so their errors say little about the network."""

SETTLING = 100
"""Batches from which the moments of batch normalisation are taken at the end."""

SAVING = 15.0
"""Seconds between checkpoints, at least: on a GPU a pass takes one or two."""

VALIDATION_BATCH = 256
"""Examples of 64 x 64 pixels at a time in validation: without gradients more of them fit."""

VALIDATION_SAMPLES = 4
"""Samples of each validation example, for networks that sample."""


@dataclass(frozen=True)
class Trained:
    """The generator with its best weights, on the processor, and one row per epoch."""

    generator: Generator
    history: pd.DataFrame


def train(
    training: ExampleSet,
    validation: ExampleSet,
    architecture: Architecture,
    rules: TrainingRules,
    *,
    seed: int,
    checkpoint: Path,
    identity: str,
    device: str = "cpu",
    initial_weights: Mapping[str, Tensor] | None = None,
    on_progress: Callable[[int, dict[str, float]], None] = lambda epoch, row: None,
) -> Trained:
    """Train, or resume from the checkpoint if it is of the same training.

    Parameters
    ----------
    seed : int
        Of initial weights, order of examples and dropout. Equal seeds give equal weights.
    identity : str
        Hash of everything that the training depends on; a checkpoint with another hash is ignored.
    initial_weights : mapping of str to Tensor, optional
        The generator's initial weights, instead of random ones: a warm restart (Loshchilov and Hutter
        2017, arXiv:1608.03983).

    Raises
    ------
    RaptorError
        If a loss is no longer finite.
    """
    place = _prepare(device)
    keep_if_they_fit([training, validation], place)
    learner = Learner(architecture, training.scaling, rules, seed % 2**63, place)
    if initial_weights is not None:
        learner.generator.start_from(initial_weights)
    # Noise multiplies features, so the moments of a batch are not those of all examples: networks that learn
    # with the former alone give wild samples in prediction, some with 20 times the deviation.
    keeping = rules.epochs // 2 if architecture.noise else rules.epochs
    history, best = _resume(learner, checkpoint, identity)
    saved = -np.inf
    for epoch in range(len(history), rules.epochs):
        if epoch == keeping:
            _settle(learner.generator, training, rules.batch_size, seed, place)
        if epoch >= keeping and not learner.keeps_moments:
            learner.keep_moments()
        row = _train_epoch(learner, training, validation, seed, epoch, place)
        earlier = history[keeping:] if learner.keeps_moments else history
        if row["validation_error"] < min((r["validation_error"] for r in earlier), default=np.inf):
            best = {k: v.detach().cpu().clone() for k, v in learner.generator.state_dict().items()}
        history.append(row)
        if time.monotonic() - saved > SAVING or epoch == rules.epochs - 1:
            state = {"identity": identity, "learner": learner.state_dict(), "history": history, "best": best}
            with atomic_path(checkpoint) as temporary:
                torch.save(state, temporary)
            saved = time.monotonic()
        log.info("%s", ", ".join(f"{key} {value:.4g}" for key, value in row.items()))
        on_progress(epoch, row)
    learner.generator.load_state_dict(best)
    if keeping == rules.epochs:
        _settle(learner.generator, training, rules.batch_size, seed, place)
    return Trained(learner.generator.cpu().eval(), pd.DataFrame(history))


def _prepare(device: str) -> torch.device:
    """Set one thread, which weights depend on, and deterministic operations, where torch has them."""
    torch.set_num_threads(1)
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # needed for reproducible cuBLAS
    torch.use_deterministic_algorithms(True, warn_only=True)
    # Nothing here reads memory before it is written, so a GPU need not fill it.
    torch.utils.deterministic.fill_uninitialized_memory = False  # type: ignore[attr-defined]
    torch.backends.cudnn.benchmark = False
    return torch.device(device)


def _resume(
    learner: Learner, checkpoint: Path, identity: str
) -> tuple[list[dict[str, float]], dict[str, Tensor]]:
    """History and best weights of a checkpoint, whose state the learner loads; both empty without one."""
    if not checkpoint.is_file():
        return [], {}
    try:
        state = torch.load(checkpoint, map_location="cpu", weights_only=True)
    except Exception as error:
        log.warning("checkpoint %s cannot be read (%s); training starts again", checkpoint, error)
        return [], {}
    if state["identity"] != identity:
        return [], {}
    learner.load_state_dict(state["learner"])
    log.info("resumed after epoch %d", len(state["history"]) - 1)
    return state["history"], state["best"]


def _train_epoch(
    learner: Learner,
    training: ExampleSet,
    validation: ExampleSet,
    seed: int,
    epoch: int,
    device: torch.device,
) -> dict[str, float]:
    """One pass over the samples, each in a random image, in random order; returns its row of the history."""
    started = time.perf_counter()
    torch.manual_seed(int(np.random.SeedSequence([seed, epoch]).generate_state(1)[0]))
    size = learner.rules.batch_size
    order = training.shuffled()
    if len(order) % size == 1 and len(order) > 1:
        order.pop()  # batch normalisation needs more than one example
    learner.start_epoch(epoch)
    losses = torch.stack(
        [learner.step(*batch) for batch in training.batches(order, size, device, shifted=True)]
    )
    # Read once per epoch, so that a GPU does not wait for the processor at every step.
    row = {"epoch": epoch, **dict(zip(LOSSES, losses.mean(0).tolist(), strict=True))}
    row["validation_error"] = validation_error(learner.generator, validation, device)
    row["seconds"] = time.perf_counter() - started
    if not np.isfinite(list(row.values())).all():
        raise RaptorError(
            f"training diverged in epoch {epoch} ({row}); lower the model's learning_rate and run again"
        )
    return row


def _settle(
    generator: Generator, examples: ExampleSet, batch_size: int, seed: int, device: torch.device
) -> None:
    """Take the moments of batch normalisation from many batches, instead of from the last few.

    See Wu and Johnson 2021 (arXiv:2105.07576).
    """
    norms = generator.normalisations()
    if not norms:
        return
    torch.manual_seed(seed % 2**63)
    stream = torch.Generator().manual_seed(seed % 2**63)
    count = SETTLING * batch_size
    order = [number for _ in range(-(-count // len(examples.images))) for number in examples.shuffled()][
        :count
    ]
    generator.eval()
    for norm in norms:
        norm.reset_running_stats()
        norm.momentum = None  # a mean over batches
        norm.train()
    with torch.no_grad():
        for inputs, target in examples.batches(order, batch_size, device):
            generator.answers(inputs, cells_of(target, examples.scaling), 1, stream)
    generator.eval()


def validation_error(generator: Generator, examples: ExampleSet, device: torch.device) -> float:
    """Mean over the fields `SCORED` of the VRMSE over all samples together, each in its first image.

    Error and variance are summed over the samples before division, so that a sample in which nothing
    happens, with almost no variance, does not dominate. For networks that sample, the CRPS replaces the root
    mean square error.
    """
    generator.eval()
    power = 1 if generator.noise else 2
    stream = torch.Generator().manual_seed(0)
    error, variance = torch.zeros(2, len(SCORED), dtype=torch.float64, device=device)
    first = [numbers[0] for numbers in examples.images.values()]
    size = max(VALIDATION_BATCH * 64**2 // examples.pixels**2, 1)
    with torch.no_grad():
        for inputs, target in examples.batches(first, size, device):
            cells, wanted = cells_of(target, examples.scaling), target[:, SCORED].double()
            answers = generator.answers(inputs, cells, VALIDATION_SAMPLES, stream)[:, :, SCORED].double()
            if generator.noise:
                found = almost_fair_score(answers, wanted, torch.abs)
            else:
                found = (answers[:, 0] - wanted) ** 2
            error += found.mean(dim=(2, 3)).sum(dim=0)
            variance += wanted.var(dim=(2, 3), correction=0).sum(dim=0)
    mean, deviation = error / len(first), torch.sqrt(variance.clamp(min=1e-12) / len(first))
    return float((mean ** (1 / power) / deviation).mean())


def joined(begun: pd.DataFrame, history: pd.DataFrame) -> pd.DataFrame:
    """The history of a training appended to that of the one that it continues."""
    return pd.concat([begun, history.assign(epoch=history["epoch"] + len(begun))], ignore_index=True)


def describe(
    rules: TrainingRules,
    seed: int,
    runs: Mapping[str, int] | None = None,
    fraction: float = 1.0,
    initial_weights: str | None = None,
) -> dict[str, Any]:
    """How a network was trained, for model.json: rules, seed, data, and the model it started from.

    `runs` is the number of training runs by campaign, `fraction` its share of the training splits.
    """
    return {
        "training": rules.model_dump()
        | {
            "seed": seed,
            "runs": dict(runs or {}),
            "training_fraction": fraction,
            "initial_weights": initial_weights,
        },
        "torch": torch.__version__,
    }
