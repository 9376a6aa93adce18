"""Training of a surrogate: resumable, deterministic, the best weights kept."""

import logging
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from torch import Tensor, nn

from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path
from raptor.dataset.examples import Example
from raptor.dataset.loader import ExampleSet
from raptor.dataset.scaling import INPUTS, Scaling
from raptor.surrogate.batches import Batches, Feeder, fit_on
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
        Weight of the distance to the target, an L1 term in pix2pix (there 100).
    adversarial : float
        Weight of the discriminator's judgement (1 in pix2pix); 0 trains without one.
    seed : int
        Of first weights, order of examples and dropout.
    threads : int
        Processor threads; trained weights are equal for an equal number.
    workers : int
        Processes that read examples ahead; weights do not depend on them.
    device : str
        cpu or cuda.
    precision : str
        float32, or bfloat16 where networks are evaluated (weights, losses and steps stay float32).
    compiled : bool
        Whether torch compiles the networks.
    loss : str
        The distance: l1, or relative (`losses.relative_distance`).
    deterministic : bool
        Whether only operations are used that give the same weights every time, where torch has them.
    """

    epochs: int
    batch_size: int
    learning_rate: float
    beta1: float
    lambda_l1: float
    seed: int
    threads: int
    workers: int = 0
    device: str = "cpu"
    precision: str = "float32"
    compiled: bool = False
    deterministic: bool = True
    adversarial: float = 1.0
    loss: str = "l1"


def rules_of(settings: Mapping[str, Any], seed: int, threads: int, device: str) -> TrainingRules:
    """The training that a configuration's block `surrogate` asks for."""
    names = (
        "epochs", "batch_size", "learning_rate", "beta1", "lambda_l1", "workers", "precision", "compiled",
        "deterministic", "loss",
    )  # fmt: skip
    judged = settings["adversarial"]
    if judged is None:
        judged = 1.0 if settings["network"] == "pix2pix" else 0.0
    return TrainingRules(
        **{name: settings[name] for name in names},
        seed=seed % 2**63,
        threads=threads,
        device=device,
        adversarial=judged,
    )


@dataclass
class _State:
    """Everything that training changes; `generate` and `judge` evaluate the two networks."""

    generator: Generator
    discriminator: Discriminator
    optimisers: tuple[torch.optim.Adam, torch.optim.Adam]
    generate: Callable[[Tensor, Tensor], Tensor]
    judge: Callable[[Tensor, Tensor], Tensor]
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
    stacks: Path | Sequence[Path],
    examples: list[Example],
    splits: list[str],
    scaling: Scaling,
    architecture: Architecture,
    rules: TrainingRules,
    checkpoint: Path,
    identity: str,
    progress: Callable[[int, dict[str, float]], None] = lambda epoch, row: None,
    begun: Mapping[str, Tensor] | None = None,
) -> Trained:
    """Train, or go on from the checkpoint if it is of the same training.

    Parameters
    ----------
    splits : list of str
        Split of each sample of the stacks, rows counted through them.
    identity : str
        Hash of everything the training hangs on; a checkpoint of another one is ignored.
    begun : mapping of str to Tensor, optional
        The generator's weights to start from, in place of random ones: a warm restart (Loshchilov and
        Hutter 2017, arXiv:1608.03983).

    Raises
    ------
    RaptorError
        Where a split has no example, or the loss is no longer finite.
    """
    device = _prepare(rules)
    datasets = {}
    for name in ("train", "validation"):
        chosen = [example for example in examples if splits[example.sample] == name]
        if not chosen:
            raise RaptorError(f"there is no {name} example; raise design.simulations or design.{name}")
        datasets[name] = ExampleSet(stacks, chosen, scaling, architecture.pixels)
    resident = fit_on(device, list(datasets.values()))
    feeders = {name: Feeder(dataset, device, rules.workers, resident) for name, dataset in datasets.items()}
    state = _start(architecture, scaling, rules, device)
    if begun is not None:
        state.generator.load_state_dict(begun)
    _resume(state, checkpoint, identity)
    for epoch in range(len(state.history), rules.epochs):
        started = time.perf_counter()
        losses = _train_epoch(state, feeders["train"], scaling, rules, epoch)
        held_out = feeders["validation"]
        batches = held_out.batches(range(len(held_out)), rules.batch_size)
        error = validation_error(state.generator, scaling, batches)
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


def _prepare(rules: TrainingRules) -> torch.device:
    """Threads, determinism and device as the rules have them."""
    torch.set_num_threads(rules.threads)
    if rules.deterministic:
        os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # without it cuBLAS may not repeat itself
    torch.use_deterministic_algorithms(rules.deterministic, warn_only=True)
    torch.backends.cudnn.benchmark = not rules.deterministic
    return torch.device(rules.device)


def _start(
    architecture: Architecture, scaling: Scaling, rules: TrainingRules, device: torch.device
) -> _State:
    torch.manual_seed(rules.seed)
    generator, discriminator = Generator(architecture, scaling), Discriminator(architecture)
    # Convolutions of a GPU's tensor cores want the channels together.
    layout = torch.channels_last if device.type == "cuda" else torch.contiguous_format
    if architecture.network in ("pix2pix", "modulated"):
        initialise(generator)
        initialise(discriminator)
    for network in (generator, discriminator):
        network.to(device=device, memory_format=layout)  # type: ignore[call-overload]
    optimisers = [
        torch.optim.Adam(network.parameters(), rules.learning_rate, (rules.beta1, 0.999))
        for network in (generator, discriminator)
    ]
    generate: Callable[[Tensor, Tensor], Tensor] = _evaluated(generator, rules)
    judge: Callable[[Tensor, Tensor], Tensor] = _evaluated(discriminator, rules)
    return _State(generator, discriminator, (optimisers[0], optimisers[1]), generate, judge, [], {})


def _evaluated(network: nn.Module, rules: TrainingRules) -> Callable[..., Tensor]:
    """A network as it is evaluated in training: compiled, and in the precision asked for."""
    called: Callable[..., Tensor] = torch.compile(network) if rules.compiled else network
    if rules.precision == "float32":
        return called

    def evaluate(*images: Tensor) -> Tensor:
        with torch.autocast(rules.device, torch.bfloat16):
            found = called(*images)
        return found.float()

    return evaluate


def _resume(state: _State, checkpoint: Path, identity: str) -> None:
    if not checkpoint.is_file():
        return
    try:
        packed = torch.load(checkpoint, map_location="cpu", weights_only=True)
    except Exception as error:
        log.warning("checkpoint %s cannot be read (%s); training starts anew", checkpoint, error)
        return
    if packed["identity"] == identity:
        state.unpack(packed)
        log.info("resumed after epoch %d", len(state.history) - 1)


def _train_epoch(
    state: _State, feeder: Feeder, scaling: Scaling, rules: TrainingRules, epoch: int
) -> dict[str, float]:
    """One pass over the examples in an order of the epoch's own; returns mean losses."""
    torch.manual_seed(int(np.random.SeedSequence([rules.seed, epoch]).generate_state(1)[0]))
    order = torch.randperm(len(feeder)).tolist()
    if len(order) % rules.batch_size == 1 and len(order) > 1:
        order.pop()  # a batch of one has no statistics to normalise by
    rate = rules.learning_rate * min(1.0, 2 * (1 - epoch / rules.epochs))
    for optimiser in state.optimisers:
        for group in optimiser.param_groups:
            group["lr"] = rate
    state.generator.train()
    state.discriminator.train()
    losses = [
        _step(state, inputs, target, cells_of(target, scaling), rules)
        for inputs, target in feeder.batches(order, rules.batch_size)
    ]
    # Read once an epoch: a GPU need not wait for the processor at every step.
    means = torch.stack(losses).mean(0).tolist()
    return dict(zip(("generator_loss", "distance", "discriminator_loss"), means, strict=True))


def cells_of(fields: Tensor, scaling: Scaling) -> Tensor:
    """Numbers of cells (n,) that scaled fields (n, 8, y, x) hold: the sum of their density."""
    return (fields[:, 0].double() * scaling.scale[0] + scaling.offset[0]).sum((1, 2)).float()


def _step(state: _State, inputs: Tensor, target: Tensor, cells: Tensor, rules: TrainingRules) -> Tensor:
    """One step of the discriminator, if any, then of the generator; their losses and the distance, (3,)."""
    prediction = state.generate(inputs, cells)
    judged = torch.zeros((), device=inputs.device)
    if rules.adversarial:
        state.optimisers[1].zero_grad(set_to_none=True)
        judged = discriminator_loss(state.judge(inputs, target), state.judge(inputs, prediction.detach()))
        judged.backward()  # type: ignore[no-untyped-call]
        state.optimisers[1].step()

    state.optimisers[0].zero_grad(set_to_none=True)
    state.discriminator.requires_grad_(False)
    opinion = state.judge(inputs, prediction) if rules.adversarial else None
    loss = generator_loss(opinion, prediction, target, rules.lambda_l1, rules.adversarial, rules.loss)
    loss.total.backward()  # type: ignore[no-untyped-call]
    state.discriminator.requires_grad_(True)
    state.optimisers[0].step()
    return torch.stack([loss.total.detach(), loss.distance.detach(), judged.detach()]).double()


def validation_error(generator: Generator, scaling: Scaling, batches: Batches) -> float:
    """Mean over the fields `SCORED` of the VRMSE of all examples taken together.

    Error and variance are summed over the examples before they are divided: an example in which
    nothing happens, and whose own variance is next to nothing, does not drown the others.
    """
    generator.eval()
    error, variance = np.zeros(len(SCORED)), np.zeros(len(SCORED))
    with torch.no_grad():
        for inputs, target in batches:
            predicted, wanted = generator(inputs, cells_of(target, scaling))[:, SCORED], target[:, SCORED]
            error += (
                ((predicted - wanted) ** 2).mean(dim=(2, 3), dtype=torch.float64).sum(dim=0).cpu().numpy()
            )
            variance += wanted.double().var(dim=(2, 3), correction=0).sum(dim=0).cpu().numpy()
    return float(np.sqrt(error / np.maximum(variance, 1e-12)).mean())


def samples_a_second(architecture: Architecture, rules: TrainingRules, steps: int = 3) -> float:
    """Examples a second that steps of training take, reading left out; for benchmarks."""
    device = _prepare(rules)
    scaling = Scaling((0.0,) * len(FIELDS), (1.0,) * len(FIELDS))
    state = _start(architecture, scaling, rules, device)
    shape = (rules.batch_size, architecture.pixels, architecture.pixels)
    inputs = torch.randn(shape[0], len(INPUTS), *shape[1:], device=device)
    target = torch.rand(shape[0], len(FIELDS), *shape[1:], device=device)
    for _ in range(2):  # the first ones also plan and compile
        _step(state, inputs, target, cells_of(target, scaling), rules).tolist()
    started = time.perf_counter()
    for _ in range(steps):
        losses = _step(state, inputs, target, cells_of(target, scaling), rules)
    losses.tolist()  # waits for a GPU to be done
    return steps * rules.batch_size / (time.perf_counter() - started)


def joined(begun: pd.DataFrame, history: pd.DataFrame) -> pd.DataFrame:
    """The history of a training behind that of the one that it continues, epochs counted on."""
    return pd.concat([begun, history.assign(epoch=history["epoch"] + len(begun))], ignore_index=True)


def write_history(path: Path, history: pd.DataFrame) -> None:
    """Write one row an epoch as CSV."""
    with atomic_path(path) as temporary:
        history.to_csv(temporary, index=False)


def describe(
    architecture: Architecture,
    rules: TrainingRules,
    extra: str | None = None,
    continues: str | None = None,
) -> dict[str, Any]:
    """Architecture and rules, the further set learned from and the model gone on from, for model.json."""
    return {
        "architecture": architecture.as_json(),
        "training": asdict(rules) | {"extra": extra, "continues": continues},
        "torch": torch.__version__,
    }
