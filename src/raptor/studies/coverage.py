"""What a campaign's moulds cover: descriptors of drawn moulds, and known moulds within their range or not."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.spatial import KDTree

from raptor.moulds.geometry import Mould
from raptor.moulds.library import MOULDS
from raptor.moulds.raster import mould_image
from raptor.moulds.reading import read_at_scale
from raptor.surrogate.bands import USUAL
from raptor.surrogate.out_of_distribution import MOULD_DESCRIPTORS, TrainingSet, mould_descriptors

PIXELS = 256


def describe_moulds(moulds: Iterable[Mould]) -> pd.DataFrame:
    """Descriptors of moulds, one row each: name, family and `MOULD_DESCRIPTORS`."""
    rows = []
    for mould in moulds:
        image = mould_image(mould, PIXELS)
        values = mould_descriptors(image.depression, image.tethers)
        row = {"mould": mould.name, "family": mould.family or ""}
        rows.append(row | dict(zip(MOULD_DESCRIPTORS, values.tolist(), strict=True)))
    return pd.DataFrame(rows)


def known_moulds(mould_scale: float) -> list[Mould]:
    """Moulds of the library, its tissues' among them, at the scale at which they are cast."""
    return [replace(read_at_scale(path, mould_scale), name=name) for name, path in MOULDS.items()]


def coverage(drawn: pd.DataFrame, known: pd.DataFrame) -> pd.DataFrame:
    """Known moulds against drawn ones: descriptors, which are out of range, and the distance to the nearest.

    Both tables are those of `describe_moulds`. Column `outside` names the descriptors below the smallest or
    above the largest of the drawn moulds. The distance, each descriptor over its deviation, is relative to
    that which `bands.USUAL` of the drawn moulds stay below from their nearest neighbour.
    """
    names = list(MOULD_DESCRIPTORS)
    points, given = drawn[names].to_numpy(), known[names].to_numpy()
    training = TrainingSet(points)
    among = np.asarray(KDTree(points / training.deviation).query(points / training.deviation, k=2)[0])
    nearest = np.array([training.distance(point) for point in given])
    beyond = (given < points.min(axis=0)) | (given > points.max(axis=0))
    outside = [", ".join(np.array(names)[row]) for row in beyond]
    return known.assign(outside=outside, distance=nearest / float(np.quantile(among[:, 1], USUAL)))
