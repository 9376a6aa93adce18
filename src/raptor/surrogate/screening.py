"""Many moulds at once, as fast as networks allow: for searches, which look at more than they keep."""

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from raptor.dataset.scaling import scale_inputs
from raptor.parameters import CellParameters
from raptor.surrogate.inference import BATCH, Surrogate
from raptor.symmetry import Element, apply, move_pixels


def outcomes(
    surrogate: Surrogate,
    images: NDArray[np.float32],
    cells: Sequence[int],
    parameters: CellParameters,
    count: int = 1,
) -> NDArray[np.float32]:
    """Fields (n, count, 8, y', x') of n moulds on the networks' raster, in physical units.

    Each of the `count` outcomes is one network's answer to one image under D4, moved back: networks take
    turns, each with images of its own; eight times the networks are all. Networks that sample give one
    sample each, of the noise that predictions have there, so moulds are compared under equal chances.

    Parameters
    ----------
    images : ndarray (n, 3, y', x')
        What networks see of each mould: `resample.coarse_images`.
    cells : sequence of int
        Number of cells in each mould.

    Raises
    ------
    RaptorError
        If the parameters are out of the range that was sampled.
    """
    parameters.require_sampled("prediction")
    pixels, noise = surrogate.architecture.pixels, surrogate.noise(len(Element.all()))
    totals = torch.tensor(cells, dtype=torch.float32) * (pixels / surrogate.pixels) ** 2
    found = np.empty((len(images), count, 8, pixels, pixels), np.float32)
    for number in range(count):
        turn, member = divmod(number, len(surrogate.members))
        element = Element.from_index((turn + member) % 8)
        for start in range(0, len(images), BATCH):
            part = slice(start, start + BATCH)
            moved = move_pixels(images[part], element)
            inputs = torch.from_numpy(np.stack([scale_inputs(image, parameters) for image in moved]))
            own = noise[member][element.index].expand(len(inputs), -1)
            with torch.no_grad():
                scaled = surrogate.members[member](inputs, totals[part], own if own.shape[1] else None)
            fields = surrogate.scaling.inverse(scaled.numpy())
            found[part, number] = apply(fields, element.inverse)
    return found
