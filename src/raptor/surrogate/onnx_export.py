"""Networks as ONNX, which runs without torch: a graph of the architecture, and weights of each member."""

import logging
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor, nn

from raptor.core.errors import RaptorError
from raptor.dataset.scaling import INPUTS
from raptor.fields.resample import deconvolve
from raptor.surrogate.generator import Generator
from raptor.surrogate.inference import Surrogate

if TYPE_CHECKING:
    import onnx

WEIGHTS = "weights"
"""Name under which the graph looks for the weights of a member."""


@dataclass(frozen=True)
class OnnxNetworks:
    """The networks of a surrogate.

    Parameters
    ----------
    graph : bytes
        ONNX model from inputs (n, 6, y, x), cells (n,) and, of networks that sample, noise (n, k) to fields
        (n, 8, y, x), all scaled as `Generator` has them. Its weights are external data called `WEIGHTS`,
        float32.
    weights : tuple of bytes
        Of each member, in the order that the graph wants, as float16.
    refine : bytes
        ONNX model from images (n, y, x) on the raster of the networks to fine ones on that of the
        predictions; empty where both are the same.
    """

    graph: bytes
    weights: tuple[bytes, ...]
    refine: bytes

    def model(self, member: int) -> bytes:
        """The graph with the weights of a member inside: a whole ONNX model."""
        from onnx import load_model_from_string

        model = load_model_from_string(self.graph)
        content = np.frombuffer(self.weights[member], np.float16).astype(np.float32).tobytes()
        for tensor in model.graph.initializer:
            if tensor.external_data:
                place = {entry.key: entry.value for entry in tensor.external_data}
                start, length = int(place["offset"]), int(place["length"])
                tensor.raw_data = content[start : start + length]
                tensor.data_location = 0
                del tensor.external_data[:]
        return bytes(model.SerializeToString())


def export_networks(surrogate: Surrogate) -> OnnxNetworks:
    """The networks of a surrogate as ONNX, their weights in half precision.

    Raises
    ------
    RaptorError
        If the packages that write ONNX are missing, or the architecture has operations that ONNX lacks.
    """
    first, pixels = surrogate.members[0], surrogate.architecture.pixels
    arguments = {"inputs": torch.zeros(2, len(INPUTS), pixels, pixels), "cells": torch.ones(2)}
    if first.noise:
        arguments["noise"] = torch.zeros(2, first.noise)
    try:
        graph = _graph(first, arguments, "fields")
        coarse = {"images": torch.zeros(2, pixels, pixels)}
        refine = None if pixels == surrogate.pixels else _graph(Refinement(surrogate.pixels), coarse, "fine")
    except ImportError as error:
        raise RaptorError(
            f"a network is written as ONNX by the package {error.name}, which is missing; "
            "install raptor-tissue[designer]"
        ) from error
    except torch.onnx.errors.OnnxExporterError as error:
        raise RaptorError(
            f"a network of kind {surrogate.architecture.network} cannot be written as ONNX, which has no "
            "complex numbers; film_unet and pix2pix can"
        ) from error
    names = _outsourced(graph, set(first.state_dict()))
    weights = tuple(_half(member, names) for member in surrogate.members)
    fine = b"" if refine is None else refine.SerializeToString()
    return OnnxNetworks(graph.SerializeToString(), weights, fine)


class Refinement(nn.Module):
    """Full resolution from block averages: `deconvolve`."""

    def __init__(self, pixels: int) -> None:
        super().__init__()
        self.pixels = pixels

    def forward(self, images: Tensor) -> Tensor:
        """Images (n, pixels, pixels) from images (n, y, x)."""
        return deconvolve(images, self.pixels)


def _graph(network: nn.Module, arguments: Mapping[str, Tensor], output: str) -> "onnx.ModelProto":
    """The ONNX model of a network for any number of images; its weights keep their names."""
    from onnxscript import optimizer

    images = torch.export.Dim("images", min=1, max=256)
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of torch about itself
        program = torch.onnx.export(
            network, (), kwargs=dict(arguments), dynamo=True, optimize=False, verbose=False,
            dynamic_shapes={name: {0: images} for name in arguments},
            input_names=list(arguments), output_names=[output],
        )  # fmt: skip
    assert program is not None  # it is only where a file is written
    # Not `optimize`, which merges normalisation into weights that half precision then rounds.
    optimizer.inline(program.model)
    optimizer.fold_constants(program.model, onnx_shape_inference=True)
    optimizer.remove_unused_nodes(program.model)
    model: onnx.ModelProto = program.model_proto
    for node in model.graph.node:  # where in the code each came from
        node.ClearField("metadata_props")
        node.ClearField("doc_string")
    model.graph.ClearField("value_info")
    model.graph.ClearField("metadata_props")
    return model


def _outsourced(graph: "onnx.ModelProto", known: set[str]) -> list[str]:
    """Make the tensors of a graph whose names are known external data; returns their names in order."""
    names, offset = [], 0
    for tensor in graph.graph.initializer:
        if tensor.name not in known or tensor.data_type != tensor.FLOAT:
            continue
        length = 4 * int(np.prod(tensor.dims, dtype=np.int64))
        tensor.ClearField("raw_data")
        tensor.ClearField("float_data")
        tensor.data_location = tensor.EXTERNAL
        for key, value in (("location", WEIGHTS), ("offset", offset), ("length", length)):
            entry = tensor.external_data.add()
            entry.key, entry.value = key, str(value)
        names.append(tensor.name)
        offset += length
    return names


def _half(network: Generator, names: list[str]) -> bytes:
    """Tensors of a network by name, one after the other, as float16."""
    tensors = network.state_dict()
    return b"".join(tensors[name].detach().cpu().numpy().astype(np.float16).tobytes() for name in names)
