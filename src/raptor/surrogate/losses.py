"""Losses of pix2pix (Isola et al. 2017, section 3.1), and of training without its discriminator."""

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, l1_loss

from raptor.fields.metrics import without_sign


def reconstruction_loss(prediction: Tensor, target: Tensor, *, signed: bool) -> Tensor:
    """Mean absolute error of scaled fields (n, 8, y, x).

    sxsz and sysz are compared by magnitude unless `signed`. Their sign is spontaneous: a network asked for
    it learns to say zero, unless a discriminator asks for fields that look simulated.
    """
    if not signed:
        prediction, target = without_sign(prediction), without_sign(target)
    return l1_loss(prediction, target)


def adversarial_loss(logits_of_prediction: Tensor) -> Tensor:
    """What the generator pays where the discriminator tells its prediction from a simulation."""
    return _cross_entropy(logits_of_prediction, simulated=True)


def discriminator_loss(logits_of_target: Tensor, logits_of_prediction: Tensor) -> Tensor:
    """What the discriminator pays; halved, as published, to slow it down."""
    simulated = _cross_entropy(logits_of_target, simulated=True)
    return 0.5 * (simulated + _cross_entropy(logits_of_prediction, simulated=False))


def _cross_entropy(logits: Tensor, *, simulated: bool) -> Tensor:
    return binary_cross_entropy_with_logits(logits, torch.full_like(logits, float(simulated)))
