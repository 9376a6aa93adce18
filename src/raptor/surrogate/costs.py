"""Cost of training and using a model."""

import time
from dataclasses import replace
from statistics import median

import pandas as pd

from raptor.moulds.reading import read_mould
from raptor.parameters import CellParameters
from raptor.surrogate.inference import Surrogate

MOULD = "four_post_rectangle"
PARAMETERS = CellParameters(0.5, 0.4, 0.2)
REPEATS = 5


def costs_of(surrogate: Surrogate, history: pd.DataFrame | None) -> dict[str, float | str | int]:
    """Number of weights, training time (one thread; with a history) and milliseconds per prediction.

    Predictions of the eight fields in physical units: one image by one network, all eight images by one
    network, and those by all networks, on torch's threads; medians of a few.
    """
    one = replace(surrogate, members=surrogate.members[:1])
    training: dict[str, float | str | int] = {}
    if history is not None:
        training["epochs"] = int(history["epoch"].max()) + 1
        training["training_core_minutes"] = float(history["seconds"].sum() / 60)
    return training | {
        "network": surrogate.architecture.network,
        "pixels": surrogate.architecture.pixels,
        "ensemble_size": len(surrogate.members),
        "weights": surrogate.weights,
        "one_image_ms": _milliseconds(one, averaged=False),
        "eight_images_ms": _milliseconds(one, averaged=True),
        "all_ms": _milliseconds(surrogate, averaged=True),
    }


def _milliseconds(surrogate: Surrogate, *, averaged: bool) -> float:
    """Of one prediction of `MOULD`."""
    cast = surrogate.cast(read_mould(MOULD))
    times = []
    for _ in range(REPEATS + 1):  # the first is a warm-up
        started = time.perf_counter()
        surrogate.predict(cast, [PARAMETERS], averaged=averaged)
        times.append(1000 * (time.perf_counter() - started))
    return median(times[1:])
