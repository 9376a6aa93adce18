"""Augmentation by D4: which images of which samples are examples for training."""

import csv
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path, decoded
from raptor.dataset.netcdf import create
from raptor.dataset.scaling import Scaling, fit_scaling
from raptor.dataset.stack import Sample, create_stack, read_samples, read_table
from raptor.symmetry import FIELDS, Element, apply, move_pixels


@dataclass(frozen=True)
class Example:
    """One image of one sample: a row of the stack and an element of D4 (0 to 7)."""

    sample: int
    element: int


def mould_images(sample: Sample) -> list[bytes]:
    """The eight images of a sample's mould, comparable byte by byte."""
    masks = np.stack([sample.depression, sample.tethers])
    return [np.packbits(move_pixels(masks, element)).tobytes() for element in Element.all()]


def augment(stack: Path, splits: Iterable[str] = ("train", "validation")) -> list[Example]:
    """Every distinct image of every sample: a copy whose mould image equals an earlier is left out.

    Moulds are compared with all earlier ones, not only with their own images, so an image that
    two moulds share is listed once.
    """
    seen: set[bytes] = set()
    examples = []
    rows = read_table(stack).rows(*splits)
    for row, sample in zip(rows, read_samples(stack, rows), strict=True):
        for element, image in enumerate(mould_images(sample)):
            if image not in seen:
                seen.add(image)
                examples.append(Example(row, element))
    return examples


def with_further(
    stack: Path, examples: list[Example], further: Iterable[Path]
) -> tuple[list[Example], list[str]]:
    """Examples of a stack and of the training samples of further ones, and splits of all their samples.

    Rows are counted through the stacks, as `ExampleSet` counts them.
    """
    joined, splits = list(examples), list(read_table(stack).split)
    for other in further:
        joined += [
            replace(example, sample=len(splits) + example.sample) for example in augment(other, ["train"])
        ]
        splits += read_table(other).split
    return joined, splits


def training_scaling(stack: Path) -> Scaling:
    """Scaling constants from the stack's training split.

    Raises
    ------
    RaptorError
        Where the stack has no training sample.
    """
    low, high = np.full(len(FIELDS), np.inf), np.full(len(FIELDS), -np.inf)
    for sample in read_samples(stack, read_table(stack).rows("train")):
        low = np.fmin(low, sample.fields.min(axis=(1, 2)))
        high = np.fmax(high, sample.fields.max(axis=(1, 2)))
    if not np.isfinite(low).all():
        raise RaptorError(f"{stack} has no training sample; lower design.test or design.validation")
    return fit_scaling(low, high)


def write_examples(path: Path, examples: list[Example]) -> None:
    """Write examples as CSV: sample, element."""
    with atomic_path(path) as temporary, temporary.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("sample", "element"))
        writer.writerows((example.sample, example.element) for example in examples)


def read_examples(path: Path) -> list[Example]:
    """Read examples.

    Raises
    ------
    RaptorError
        Where the file is missing or malformed.
    """
    try:
        lines = decoded(Path(path).read_bytes(), f"examples {path}").splitlines()
        return [Example(int(row["sample"]), int(row["element"])) for row in csv.DictReader(lines)]
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise RaptorError(f"examples {path} cannot be read: {error}") from error


def transform_sample(sample: Sample, element: Element) -> Sample:
    """The image of a sample under an element of D4: fields as tensors, masks as pixels."""
    return replace(
        sample,
        fields=apply(sample.fields, element),
        depression=np.ascontiguousarray(move_pixels(sample.depression, element)),
        tethers=np.ascontiguousarray(move_pixels(sample.tethers, element)),
    )


def materialise(path: Path, stack: Path, examples: list[Example], configuration: str) -> None:
    """Write the augmented stack as netCDF, for other people's tools."""
    with create(path, "CONDOR fields, augmented by D4", configuration) as file:
        write = create_stack(file, len(examples), read_table(stack).pixels)
        element = file.createVariable("element", "i1", ("sample",))
        element.long_name, element.units = "element of D4 that made the example", "1"
        for row, example in enumerate(examples):
            (sample,) = read_samples(stack, [example.sample])
            write(row, transform_sample(sample, Element.from_index(example.element)))
            element[row] = example.element
