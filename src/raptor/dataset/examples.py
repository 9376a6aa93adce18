"""Augmentation by D4: the images of samples that are examples for training."""

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path, decoded
from raptor.dataset.scaling import Scaling, fit_scaling
from raptor.dataset.stack import Sample, read_masks, read_samples, read_table
from raptor.symmetry import FIELDS, Element, apply, move_pixels


@dataclass(frozen=True)
class Example:
    """One image of one sample: a row of the stack and an element of D4 (0 to 7)."""

    sample: int
    element: int


def mould_images(masks: NDArray[np.uint8]) -> list[bytes]:
    """The eight images of a mould's masks (2, y, x), comparable byte by byte."""
    return [np.packbits(move_pixels(masks, element)).tobytes() for element in Element.all()]


def list_examples(stack: Path, splits: Iterable[str] = ("train", "validation")) -> list[Example]:
    """Every distinct image of every sample, without images whose mould equals an earlier one.

    Moulds are compared with all earlier ones, not only with their own images, so an image shared by two
    moulds is listed once.
    """
    seen: set[bytes] = set()
    examples, rows = [], set(read_table(stack).rows(*splits))
    for row, masks in enumerate(read_masks(stack)):
        for element, image in enumerate(mould_images(masks) if row in rows else ()):
            if image not in seen:
                seen.add(image)
                examples.append(Example(row, element))
    return examples


def training_rows(stack: Path, fraction: float = 1.0) -> list[int]:
    """Rows of a stack's training split, or the first `fraction` of them.

    Runs are drawn independently, so the first ones are a random sample, and a smaller fraction is part of a
    larger one.
    """
    rows = read_table(stack).rows("train")
    return rows[: math.ceil(fraction * len(rows))]


def join_examples(
    stacks: Sequence[Path],
    examples: Sequence[list[Example]],
    fraction: float = 1.0,
    *,
    every_image: bool = False,
) -> tuple[list[Example], list[str]]:
    """Examples of several stacks as one list, and the splits of all their samples.

    Rows are numbered consecutively through the stacks, as in `ExampleSet`. Of each stack: the examples of
    `training_rows` and of the validation split.

    Parameters
    ----------
    every_image : bool
        Add the images of a symmetric mould that repeat it: the mould repeats, the tissue in it does not.
    """
    joined: list[Example] = []
    splits: list[str] = []
    for stack, listed in zip(stacks, examples, strict=True):
        table = read_table(stack)
        used = {*training_rows(stack, fraction), *table.rows("validation")}
        chosen = [example for example in listed if example.sample in used]
        if every_image:
            rows = dict.fromkeys(example.sample for example in chosen)
            chosen = [Example(row, element) for row in rows for element in range(len(Element.all()))]
        joined += [replace(example, sample=len(splits) + example.sample) for example in chosen]
        splits += table.split
    return joined, splits


def training_scaling(*stacks: Path, fraction: float = 1.0) -> Scaling:
    """Scaling constants from the `training_rows` of stacks.

    Raises
    ------
    RaptorError
        If the stacks have no training sample.
    """
    low, high = np.full(len(FIELDS), np.inf), np.full(len(FIELDS), -np.inf)
    for stack in stacks:
        for sample in read_samples(stack, training_rows(stack, fraction)):
            low = np.fmin(low, sample.fields.min(axis=(1, 2)))
            high = np.fmax(high, sample.fields.max(axis=(1, 2)))
    if not np.isfinite(low).all():
        where = ", ".join(map(str, stacks))
        raise RaptorError(f"{where}: there is no training sample; lower the campaign's test or validation")
    return fit_scaling(low, high)


def write_examples(path: Path, examples: list[Example]) -> None:
    """Write examples as CSV: sample, element."""
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("sample", "element"))
        writer.writerows((example.sample, example.element) for example in examples)


def read_examples(path: Path) -> list[Example]:
    """Read examples.

    Raises
    ------
    RaptorError
        If the file is missing or malformed.
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
