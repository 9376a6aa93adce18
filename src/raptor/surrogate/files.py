"""Trained models as files."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path, read_json, write_json
from raptor.core.version import MODEL_VERSION
from raptor.dataset.netcdf import LICENCE
from raptor.dataset.scaling import INPUTS, Scaling
from raptor.surrogate.bands import Calibration
from raptor.surrogate.generator import Generator
from raptor.surrogate.inference import Surrogate
from raptor.surrogate.rules import Architecture

DESCRIPTORS = "training_descriptors"  # beside the weights
WEIGHTS, MODEL = "weights.safetensors", "model.json"


def save(
    folder: Path, surrogate: Surrogate, description: Mapping[str, Any], identity: str, *, half: bool = False
) -> None:
    """Write weights.safetensors and model.json.

    Parameters
    ----------
    description : mapping
        How it was trained: `training.describe`.
    identity : str
        Hash of the training, stored in both files.
    half : bool
        Write weights as float16, which halves the file and changes predictions by less than 1e-3.
    """
    tensors = {
        name: value.half() if half and value.dtype == torch.float32 else value
        for name, value in nn.ModuleList(surrogate.members).state_dict().items()
    }
    calibration = surrogate.calibration
    if calibration is not None:
        tensors[DESCRIPTORS] = torch.from_numpy(calibration.training.points)
    with atomic_path(folder / WEIGHTS) as temporary:
        contiguous = {name: value.contiguous() for name, value in tensors.items()}
        save_file(contiguous, temporary, metadata={"identity": identity, "license": LICENCE})
    content = {
        **description,
        "identity": identity,
        "ensemble_size": len(surrogate.members),
        "architecture": surrogate.architecture.model_dump(),
        "inputs": list(INPUTS),
        "normalisation": surrogate.scaling.as_json(),
        "layers": surrogate.layers,
        "pixels": surrogate.pixels,
        "model_version": MODEL_VERSION,
        "license": LICENCE,
        "calibration": None if calibration is None else calibration.as_json(),
    }
    write_json(folder / MODEL, content)


def read_description(folder: Path) -> dict[str, Any]:
    """Content of model.json in a model's folder.

    Raises
    ------
    RaptorError
        If it is missing or cut short.
    """
    content: dict[str, Any] = read_json(Path(folder) / MODEL)
    return content


def load(folder: Path) -> Surrogate:
    """Load a model from its folder.

    Raises
    ------
    RaptorError
        If a file is missing or cut short, or the weights do not fit the model.
    """
    folder = Path(folder)
    content = read_description(folder)
    try:
        architecture = Architecture.model_validate(content["architecture"])
        scaling = Scaling.from_json(content["normalisation"])
        layers, pixels, count = (int(content[name]) for name in ("layers", "pixels", "ensemble_size"))
        inputs = content.get("inputs", [])
    except (ValueError, KeyError, TypeError) as error:
        raise RaptorError(
            f"{folder / MODEL} cannot be read: {error}; give a folder with both files of one training"
        ) from error
    if inputs != list(INPUTS):
        raise RaptorError(
            f"{folder / MODEL} was trained by another version, whose networks do not see "
            f"{', '.join(INPUTS)}; train it again, or use that version of raptor"
        )
    tensors, identity = _read_tensors(folder / WEIGHTS)
    members = [Generator(architecture, scaling) for _ in range(count)]
    try:
        if identity != content["identity"]:
            raise RuntimeError("they come from two trainings")
        described, calibration = content["calibration"], None
        if described is not None:
            calibration = Calibration.from_json(described, tensors.pop(DESCRIPTORS).numpy())
        nn.ModuleList(members).load_state_dict(tensors)
    except (RuntimeError, KeyError, TypeError) as error:
        raise RaptorError(
            f"{folder / WEIGHTS} does not fit the model that model.json describes; "
            f"keep the two files of one training together ({str(error).splitlines()[0]})"
        ) from error
    return Surrogate(tuple(members), architecture, scaling, layers, pixels, calibration)


def _read_tensors(path: Path) -> tuple[dict[str, Tensor], str | None]:
    """The tensors of a file of weights, and the identity of their training."""
    try:
        with safe_open(path, framework="pt") as file:
            identity = (file.metadata() or {}).get("identity")
        return load_file(path), identity
    except (OSError, SafetensorError) as error:
        raise RaptorError(
            f"{path} cannot be read: {error}; give a folder with both files of one training"
        ) from error
