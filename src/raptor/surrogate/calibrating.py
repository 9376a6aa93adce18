"""Learning on the validation split how errors follow from the spread of networks."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raptor.dataset.stack import Sample, read_samples, read_table
from raptor.errors import RaptorError
from raptor.metrics import without_sign
from raptor.moulds.geometry import Mould
from raptor.moulds.raster import MouldImage
from raptor.surrogate.calibration import USUAL, Calibration, fit_scale, relative_spread
from raptor.surrogate.inference import Surrogate, deviation
from raptor.surrogate.novelty import Novelty, descriptors

PIXELS = 400  # of each sample, chosen at random within the depression


def calibrate(
    surrogate: Surrogate,
    stack: Path,
    moulds: Mapping[str, Mould],
    seed: int,
    done: Callable[[int], None] = lambda simulation: None,
) -> Calibration:
    """The calibration of a surrogate on a stack's validation split.

    Raises
    ------
    RaptorError
        Where the stack has no validation sample.
    """
    table = read_table(stack)
    rows = table.rows("validation")
    if not rows:
        raise RaptorError(f"{stack} has no validation sample; raise design.validation")
    points = np.stack([_descriptors(sample) for sample in read_samples(stack, table.rows("train"))])
    novelty = Novelty(points.astype(np.float32))
    fields: list[NDArray[np.floating]] = []
    shapes: list[NDArray[np.floating]] = []
    disagreements, distances = [], []
    for sample in read_samples(stack, rows):
        mould = moulds[sample.mould]
        image = MouldImage(sample.depression.astype(bool), sample.tethers.astype(bool))
        predicted, spread, of_members = surrogate.ensemble(image, mould, sample.parameters, sample.n_cells)
        rng = np.random.default_rng([seed, sample.simulation])
        inside = np.flatnonzero(image.depression)
        chosen = rng.choice(inside, PIXELS, replace=len(inside) < PIXELS)
        error, wide, size = (
            part.reshape(len(part), -1)[:, chosen].T
            for part in (without_sign(predicted) - without_sign(sample.fields), spread, np.abs(predicted[:1]))
        )
        fields.append(np.stack([error, wide, np.broadcast_to(size, error.shape)]))
        true, ours = (surrogate.shape(f, image, mould) for f in (sample.fields, predicted))
        shapes.append(np.stack([ours - true, deviation(of_members), np.ones(2)]))
        disagreements.append(relative_spread(spread, predicted))
        distances.append(novelty.distance(_descriptors(sample)))
        done(sample.simulation)
    return Calibration(
        fit_scale(*np.concatenate(fields, axis=1)),
        fit_scale(*np.stack(shapes, axis=1)),
        float(np.quantile(disagreements, USUAL)),
        Novelty(novelty.points, float(np.quantile(distances, USUAL))),
    )


def _descriptors(sample: Sample) -> NDArray[np.float64]:
    return descriptors(sample.depression, sample.tethers, sample.parameters)
