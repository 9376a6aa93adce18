"""Predictions without a network, as baselines."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.dataset.examples import Example, transform_sample
from raptor.dataset.scaling import scaled_parameters
from raptor.dataset.stack import Sample, read_samples, read_table
from raptor.fields.resample import block_average
from raptor.moulds.cast import CastMould
from raptor.surrogate.rules import BASELINES
from raptor.symmetry import Element

COARSE = 16
"""Pixels of the images by which moulds are compared."""


def training_mean(stack: Path, examples: list[Example]) -> NDArray[np.float64]:
    """Mean fields (8, y, x) of the augmented training examples, the best guess without inputs."""
    total, chosen = np.zeros(()), training_examples(stack, examples)
    for sample, element in _images(stack, chosen):
        total = total + transform_sample(sample, element).fields
    return np.asarray(total / len(chosen), dtype=np.float64)


def training_examples(stack: Path, examples: list[Example]) -> list[Example]:
    """Those of the training split, by row of the stack."""
    splits = read_table(stack).split
    return sorted(
        (example for example in examples if splits[example.sample] == "train"),
        key=lambda example: (example.sample, example.element),
    )


@dataclass(frozen=True)
class Nearest:
    """Fields of the training example with the nearest mould and parameters.

    The distance is Euclidean, of masks as images of `COARSE` pixels and of scaled parameters, each over its
    mean distance in the training set.

    Parameters
    ----------
    stack : Path
    examples : list of Example
        Of the training split.
    keys : ndarray (n, numbers)
        Coarse masks, then scaled parameters, of each example.
    weights : ndarray (numbers,)
        Of squared differences.
    """

    stack: Path
    examples: list[Example]
    keys: NDArray[np.float32]
    weights: NDArray[np.float32]

    @classmethod
    def of(cls, stack: Path, examples: list[Example]) -> "Nearest":
        """The baseline of a stack's training examples."""
        chosen = training_examples(stack, examples)
        keys = np.stack([_key(transform_sample(*image)) for image in _images(stack, chosen)])
        variance = keys.var(axis=0)
        images, parameters = variance[:-3].sum(), variance[-3:].sum()
        sizes = np.r_[np.full(len(variance) - 3, images), np.full(3, parameters)]
        return cls(stack, chosen, keys, (1 / (sizes + 1e-12)).astype(np.float32))

    def fields(self, sample: Sample) -> NDArray[np.float32]:
        """Fields (8, y, x) of the nearest example."""
        distance = (((self.keys - _key(sample)) ** 2) * self.weights).sum(axis=1)
        example = self.examples[int(distance.argmin())]
        (found,) = read_samples(self.stack, [example.sample])
        return transform_sample(found, Element.from_index(example.element)).fields


def baseline(name: str, stack: Path, examples: list[Example]) -> Callable[[Sample, CastMould], NDArray[Any]]:
    """One of `BASELINES`, as a function from a sample's inputs to fields (8, y, x).

    Raises
    ------
    RaptorError
        If there is no such baseline.
    """
    if name == "nearest":
        nearest = Nearest.of(stack, examples)
        return lambda sample, cast: nearest.fields(sample)
    if name == "mean":
        mean = training_mean(stack, examples)
        return lambda sample, cast: mean
    raise RaptorError(f"there is no baseline '{name}'; known are {', '.join(BASELINES)}")


def _images(stack: Path, examples: list[Example]) -> Iterator[tuple[Sample, Element]]:
    """Samples and elements of examples in order of rows, each sample read once."""
    rows = list(dict.fromkeys(example.sample for example in examples))
    elements: dict[int, list[Element]] = {row: [] for row in rows}
    for example in examples:
        elements[example.sample].append(Element.from_index(example.element))
    for row, sample in zip(rows, read_samples(stack, rows), strict=True):
        for element in elements[row]:
            yield sample, element


def _key(sample: Sample) -> NDArray[np.float32]:
    """Coarse masks, then scaled parameters, as one vector."""
    masks = block_average(2.0 * np.stack([sample.depression, sample.tethers]) - 1.0, COARSE)
    return np.concatenate([masks.ravel(), scaled_parameters(sample.parameters)]).astype(np.float32)
