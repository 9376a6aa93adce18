"""Stand-ins for tissues and surrogates: smooth ones, whose fit is known, and one that has learnt nothing."""

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


def untrained(folder, *, calibrated=True):
    """A surrogate that has learnt nothing."""
    from raptor.dataset.scaling import Scaling
    from raptor.surrogate.bands import Calibration, ErrorScale
    from raptor.surrogate.files import save
    from raptor.surrogate.generator import Generator
    from raptor.surrogate.inference import Surrogate
    from raptor.surrogate.out_of_distribution import DESCRIPTORS, TrainingSet
    from raptor.surrogate.rules import Architecture

    architecture = Architecture(network="pix2pix", pixels=32, base_channels=4)
    scaling = Scaling((0.5,) * 8, (0.5,) * 8)
    scales = [ErrorScale((0.1,) * n, ((1.0,) * n, (2.0,) * n, (3.0,) * n)) for n in (8, 4)]
    points = np.random.default_rng(0).normal(size=(9, len(DESCRIPTORS))).astype(np.float32)
    members = tuple(Generator(architecture, scaling) for _ in range(2))
    calibration = Calibration(*scales, 0.1, TrainingSet(points, 1e-3)) if calibrated else None
    save(folder, Surrogate(members, architecture, scaling, 4, 32, calibration), {}, "x")
    return folder
