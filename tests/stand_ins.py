"""Smooth stand-ins for tissues: what a fit or a posterior finds of them is known."""

import numpy as np

from raptor.frame import pixel_centres
from raptor.parameters import CellParameters

TRUTH = CellParameters(0.6, 0.4, 0.2)


def smooth(parameters):
    """A stand-in for a tissue: both ratios fall with delta, each with a stiffness of its own."""
    return np.array(
        [
            (
                1 - 0.6 * p.delta * (1 - 0.5 * p.kappa_nnn),
                1 - 0.8 * p.delta * (1 - 0.3 * p.kappa_nnnn),
            )
            for p in parameters
        ]
    )


def ellipse(parameters, pixels=128):
    """Densities (n, y, x) of stand-ins whose two half axes and waist show a parameter each."""
    x, y = np.meshgrid(pixel_centres(pixels), pixel_centres(pixels))
    images = []
    for p in parameters:
        height = 12 * (1 - 0.5 * p.delta) * (1 - p.kappa_nnnn * np.exp(-((x / 6) ** 2)))
        radius = np.hypot(x / (24 * (1 - 0.5 * p.kappa_nnn)), y / height)
        images.append(1 / (1 + np.exp(10 * (radius - 1))))
    return np.array(images)
