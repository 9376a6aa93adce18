"""Losses of pix2pix (Isola et al. 2017, section 3.1), and of training without its discriminator."""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, l1_loss

from raptor.surrogate.constraints import SMALL, unsigned

LOSSES = ("l1", "relative")
QUIET = 0.1  # part of the batch's variance that is added to each sample's: nothing is divided by noise


@dataclass(frozen=True)
class GeneratorLoss:
    """weight * adversarial + factor * distance, and its parts."""

    total: Tensor
    adversarial: Tensor
    distance: Tensor


def generator_loss(
    logits_of_prediction: Tensor | None,
    prediction: Tensor,
    target: Tensor,
    factor: float,
    weight: float = 1.0,
    loss: str = "l1",
) -> GeneratorLoss:
    """Fool the discriminator, with a weight, and be close to the target; without logits, only that.

    sxsz and sysz are compared by magnitude where nobody judges: their sign is spontaneous, and who is asked
    for it learns to say zero.
    """
    distance_of = l1_loss if loss == "l1" else relative_distance
    if logits_of_prediction is None:
        distance = distance_of(unsigned(prediction), unsigned(target))
        return GeneratorLoss(factor * distance, torch.zeros_like(distance), distance)
    adversarial = _towards(logits_of_prediction, real=True)
    distance = distance_of(prediction, target)
    return GeneratorLoss(weight * adversarial + factor * distance, adversarial, distance)


def relative_distance(prediction: Tensor, target: Tensor) -> Tensor:
    """Mean over samples and fields (n, 8, y, x) of the root mean square error over the target's deviation.

    Of each sample and field as its VRMSE counts them, so that none is drowned by others; the relative L2
    loss of the neural-operator literature (Li et al. 2021, arXiv:2010.08895), about the mean.
    """
    error = ((prediction - target) ** 2).mean((2, 3))
    variance = target.var((2, 3), correction=0)
    return torch.sqrt((error + SMALL) / (variance + QUIET * variance.mean(0) + SMALL)).mean()


def discriminator_loss(logits_of_target: Tensor, logits_of_prediction: Tensor) -> Tensor:
    """Tell targets from predictions; halved, as published, to slow the discriminator down."""
    return 0.5 * (_towards(logits_of_target, real=True) + _towards(logits_of_prediction, real=False))


def _towards(logits: Tensor, *, real: bool) -> Tensor:
    wanted = torch.full_like(logits, float(real))
    return binary_cross_entropy_with_logits(logits, wanted)
