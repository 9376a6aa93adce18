"""Prediction: from a mould and parameters to the eight fields, in physical units."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.torch import load_file, save_file
from torch import Tensor

from raptor import MODEL_VERSION
from raptor.condor.lattice import cast_sites
from raptor.dataset.netcdf import create, variable
from raptor.dataset.scaling import Scaling, scale_inputs
from raptor.errors import RaptorError
from raptor.files import atomic_path
from raptor.morphology import area_ratio, density_threshold, width_ratio
from raptor.moulds.geometry import Mould
from raptor.moulds.raster import mould_image, pixel_centres
from raptor.parameters import CellParameters
from raptor.resolution import pooled, refined
from raptor.surrogate.feeding import apply
from raptor.surrogate.networks import Architecture, Generator
from raptor.surrogate.physics import average, project
from raptor.symmetry import FIELDS, Element, move_pixels

BATCH = 16


@dataclass(frozen=True)
class Surrogate:
    """A trained generator with what is needed to use it without its data set.

    `pixels` is the side of the images that it predicts, of which the network may see means over squares.
    """

    generator: Generator
    architecture: Architecture
    scaling: Scaling
    layers: int
    pixels: int

    def predict(
        self,
        depression: NDArray[Any],
        tethers: NDArray[Any],
        parameters: Sequence[CellParameters],
        cells: int,
        *,
        averaged: bool = True,
    ) -> NDArray[np.float32]:
        """Fields (n, 8, y, x) in physical units of one mould's masks (y, x) at n parameters.

        They obey the physics (`surrogate.physics`). `averaged` over the eight images of D4, so that the
        prediction of a turned mould is the turned prediction; then sxsz and sysz have no sign of their own.

        Parameters
        ----------
        cells : int
            Cells of the tissue, to which density sums.

        Raises
        ------
        RaptorError
            Where the masks have another size than the network, or parameters are out of its range.
        """
        pixels = self.pixels
        if depression.shape != (pixels, pixels):
            raise RaptorError(f"masks are {depression.shape}; this model takes {pixels} x {pixels} pixels")
        for values in parameters:
            values.require_sampled("prediction")
        if not parameters:
            return np.empty((0, len(FIELDS), pixels, pixels), np.float32)
        elements = Element.all() if averaged else Element.all()[:1]
        images = [
            scale_inputs(move_pixels(depression, element), move_pixels(tethers, element), values)
            for values in parameters
            for element in elements
        ]
        self.generator.eval()
        with torch.no_grad():
            parts = [
                self._evaluated(torch.from_numpy(np.stack(images[start : start + BATCH])), cells)
                for start in range(0, len(images), BATCH)
            ]
            of_each = torch.split(torch.cat(parts), len(elements))
            fields = torch.stack([_averaged(part, elements) if averaged else part[0] for part in of_each])
            if self.generator.physical is None or self.architecture.pixels < pixels:
                masks = torch.from_numpy(depression.astype(np.float32)).expand(len(fields), 1, -1, -1)
                fields = project(fields, masks, torch.full((len(fields),), float(cells)))
        return np.asarray(fields.numpy(), dtype=np.float32)

    def _evaluated(self, inputs: Tensor, cells: int) -> Tensor:
        """Fields in physical units, for scaled inputs, as the network gives them."""
        seen = self.architecture.pixels
        # Fields are in the unit of a fine pixel, of which a coarse one is the mean.
        counts = torch.full((len(inputs),), cells * (seen / self.pixels) ** 2)
        scaled = self.generator(pooled(inputs, seen), counts)
        return torch.from_numpy(self.scaling.inverse(refined(scaled, self.pixels).numpy()))

    def predict_mould(
        self, mould: Mould, parameters: CellParameters, *, averaged: bool = True
    ) -> NDArray[np.float32]:
        """Fields (8, y, x) of a mould at one set of parameters.

        Raises
        ------
        RaptorError
            As `predict`, and where the mould holds no cell.
        """
        image = mould_image(mould, self.pixels)
        cells = len(cast_sites(mould, self.layers))
        fields = self.predict(image.depression, image.tethers, [parameters], cells, averaged=averaged)
        return np.asarray(fields[0])


def _averaged(fields: Tensor, elements: Sequence[Element]) -> Tensor:
    """Mean (8, y, x) of predictions (elements, 8, y, x) of a mould's images, each moved back."""
    back = [apply(image, element.inverse) for image, element in zip(fields, elements, strict=True)]
    return average(torch.stack(back))


def save(
    folder: Path,
    weights: dict[str, Tensor],
    architecture: Architecture,
    scaling: Scaling,
    layers: int,
    pixels: int,
    description: dict[str, Any],
    identity: str,
) -> None:
    """Write weights.safetensors and model.json; `identity` of the training stands in both."""
    with atomic_path(folder / "weights.safetensors") as temporary:
        save_file(
            {name: value.contiguous() for name, value in weights.items()},
            temporary,
            metadata={"identity": identity},
        )
    content = {
        **description,
        "identity": identity,
        "architecture": architecture.as_json(),
        "normalisation": scaling.as_json(),
        "layers": layers,
        "pixels": pixels,
        "model_version": MODEL_VERSION,
    }
    with atomic_path(folder / "model.json") as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n")


def load(folder: Path) -> Surrogate:
    """Load a model from its folder.

    Raises
    ------
    RaptorError
        Where a file is missing or cut short, or the weights do not fit the model.
    """
    folder = Path(folder)
    try:
        content = json.loads((folder / "model.json").read_text())
        architecture = Architecture(**content["architecture"])
        scaling = Scaling.from_json(content["normalisation"])
        layers, pixels = int(content["layers"]), int(content["pixels"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RaptorError(f"{folder / 'model.json'} cannot be read: {error}") from error
    generator = Generator(architecture, scaling)
    try:
        weights = folder / "weights.safetensors"
        with safe_open(weights, framework="pt") as file:
            identity = (file.metadata() or {}).get("identity")
        if identity != content.get("identity"):
            raise RuntimeError("they are of two trainings")
        generator.load_state_dict(load_file(weights))
    except (OSError, SafetensorError) as error:
        raise RaptorError(f"{folder / 'weights.safetensors'} cannot be read: {error}") from error
    except RuntimeError as error:
        raise RaptorError(
            f"{folder / 'weights.safetensors'} does not fit the model that model.json describes; "
            f"keep the two files of one training together ({str(error).splitlines()[0]})"
        ) from error
    generator.eval()
    return Surrogate(generator, architecture, scaling, layers, pixels)


def write_prediction(
    path: Path, surrogate: Surrogate, mould: Mould, parameters: CellParameters
) -> tuple[float, float]:
    """Predict a mould's fields and write them, in physical units; returns A/A0 and w/w0."""
    fields = surrogate.predict_mould(mould, parameters)
    pixels = fields.shape[-1]
    threshold = density_threshold(surrogate.layers, pixels)
    area = area_ratio(fields[0], mould_image(mould, pixels), threshold)
    width = width_ratio(fields[0], mould, threshold)
    with create(path, "Fields of a tissue predicted by the RAPTOR surrogate", "prediction") as file:
        for name, size in (("sample", 1), ("field", len(FIELDS)), ("y", pixels), ("x", pixels)):
            file.createDimension(name, size)
        variable(file, "field", ("field",), np.array(FIELDS), "name of the field")
        for axis in "yx":
            variable(file, axis, (axis,), pixel_centres(pixels), f"pixel centre {axis}, in l0")
        variable(file, "fields", ("sample", "field", "y", "x"), fields[None], "fields, per pixel")
        for name, value in asdict(parameters).items():
            variable(file, name, ("sample",), [value], name)
        variable(file, "area_ratio", ("sample",), [area], "A/A0")
        variable(file, "width_ratio", ("sample",), [width], "w/w0")
    return area, width
