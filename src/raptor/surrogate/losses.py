"""Losses of pix2pix (Isola et al. 2017, section 3.1), and of training without its discriminator."""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, l1_loss

from raptor.surrogate.physics import unsigned


@dataclass(frozen=True)
class GeneratorLoss:
    """weight * adversarial + lambda_l1 * l1, and its parts."""

    total: Tensor
    adversarial: Tensor
    l1: Tensor


def generator_loss(
    logits_of_prediction: Tensor | None,
    prediction: Tensor,
    target: Tensor,
    lambda_l1: float,
    weight: float = 1.0,
) -> GeneratorLoss:
    """Fool the discriminator, with a weight, and be close to the target; without logits, only that.

    sxsz and sysz are compared by magnitude where nobody judges: their sign is spontaneous, and who is asked
    for it learns to say zero.
    """
    if logits_of_prediction is None:
        l1 = l1_loss(unsigned(prediction), unsigned(target))
        return GeneratorLoss(lambda_l1 * l1, torch.zeros_like(l1), l1)
    adversarial = _towards(logits_of_prediction, real=True)
    l1 = l1_loss(prediction, target)
    return GeneratorLoss(weight * adversarial + lambda_l1 * l1, adversarial, l1)


def discriminator_loss(logits_of_target: Tensor, logits_of_prediction: Tensor) -> Tensor:
    """Tell targets from predictions; halved, as published, to slow the discriminator down."""
    return 0.5 * (_towards(logits_of_target, real=True) + _towards(logits_of_prediction, real=False))


def _towards(logits: Tensor, *, real: bool) -> Tensor:
    wanted = torch.full_like(logits, float(real))
    return binary_cross_entropy_with_logits(logits, wanted)
