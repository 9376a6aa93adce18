"""How fast networks are trained, reading left out."""

import time

import torch

from raptor.dataset.scaling import INPUTS, Scaling
from raptor.surrogate.learner import Learner
from raptor.surrogate.rules import Architecture, TrainingRules
from raptor.symmetry import FIELDS


def published(pixels: int, channels: int) -> Architecture:
    """pix2pix of so many pixels and base channels."""
    return Architecture.model_validate({"network": "pix2pix", "pixels": pixels, "base_channels": channels})


def examples_a_second(architecture: Architecture, rules: TrainingRules, device: str, steps: int = 3) -> float:
    """Examples a second that steps of training take."""
    place = torch.device(device)
    scaling = Scaling((0.0,) * len(FIELDS), (1.0,) * len(FIELDS))
    learner = Learner(architecture, scaling, rules, 0, place)
    learner.start_epoch(0)
    size = 2 * (architecture.pixels,)
    inputs = torch.randn(rules.batch_size, len(INPUTS), *size, device=place)
    target = torch.rand(rules.batch_size, len(FIELDS), *size, device=place)
    for _ in range(2):  # the first steps also plan
        learner.step(inputs, target).tolist()
    started = time.perf_counter()
    for _ in range(steps):
        losses = learner.step(inputs, target)
    losses.tolist()  # waits for a GPU to be done
    return steps * rules.batch_size / (time.perf_counter() - started)
