"""Losses of pix2pix (Isola et al. 2017, section 3.1), without its discriminator, and of samples.

`sample_loss` takes 8 ms per batch here and 94 ms with scoringrules; the tests compare it with the formula
written out.
"""

from collections.abc import Callable
from itertools import combinations

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, l1_loss

from raptor.fields.metrics import without_sign
from raptor.fields.resample import block_average
from raptor.symmetry import FIELDS

FAIR = 0.95
"""Share of the fair score in the almost-fair one; the rest keeps samples from diverging."""

LEAST = 0.02
"""Added to Delta^2 where tension is divided by it."""

SQUARES = (2, 4, 8)
"""Sides, in pixels, of the squares over which samples are averaged for the energy scores."""


def reconstruction_loss(prediction: Tensor, target: Tensor, *, signed: bool) -> Tensor:
    """Mean absolute error of scaled fields (n, 8, y, x).

    sxsz and sysz are compared by magnitude unless `signed`. Their sign is spontaneous, so a network asked to
    predict it learns zero, unless a discriminator demands fields that look simulated.
    """
    if not signed:
        prediction, target = without_sign(prediction), without_sign(target)
    return l1_loss(prediction, target)


def balanced(fields: Tensor, delta: Tensor) -> Tensor:
    """Scaled fields (n, ..., 8, y, x) with tension over Delta^2 (n,), which it grows as.

    Otherwise its errors at small Delta would not count. `LEAST` keeps what is zero from being divided by it.
    """
    weight = torch.ones(len(FIELDS), device=fields.device).repeat(len(delta), 1)
    weight[:, FIELDS.index("tension")] = 1 / (delta**2 + LEAST)
    return fields * weight.reshape(len(delta), *(1,) * (fields.ndim - 4), len(FIELDS), 1, 1)


def sample_loss(samples: Tensor, target: Tensor) -> Tensor:
    """Distance of samples (n, m, 8, y, x), m > 1, from the distribution of targets (n, 8, y, x).

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
    """Adversarial loss of the generator."""
    return _cross_entropy(logits_of_prediction, simulated=True)


def discriminator_loss(logits_of_target: Tensor, logits_of_prediction: Tensor) -> Tensor:
    """Loss of the discriminator, halved, as published, to slow it down."""
    simulated = _cross_entropy(logits_of_target, simulated=True)
    return 0.5 * (simulated + _cross_entropy(logits_of_prediction, simulated=False))


def _cross_entropy(logits: Tensor, *, simulated: bool) -> Tensor:
    return binary_cross_entropy_with_logits(logits, torch.full_like(logits, float(simulated)))
