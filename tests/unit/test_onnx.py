"""Networks as ONNX answer as they do in torch."""

import sys

import numpy as np
import pytest
import torch

import raptor
from raptor.core.errors import RaptorError
from raptor.dataset.scaling import INPUTS
from raptor.fields.resample import block_average, deconvolve
from raptor.surrogate.generator import Generator
from raptor.surrogate.inference import Surrogate
from raptor.surrogate.networks.blocks import IMAGES
from raptor.surrogate.onnx_export import export_networks
from raptor.surrogate.rules import Architecture

pytestmark = pytest.mark.one_processor

SCALING = raptor.load_surrogate().scaling


def untrained(network, noise=0):
    """A surrogate of one small network with weights that half precision holds."""
    architecture = Architecture(network=network, pixels=32, base_channels=4, noise=noise)
    torch.manual_seed(5)
    member = Generator(architecture, SCALING)
    return Surrogate((member.half().float(),), architecture, SCALING, layers=7, pixels=64)


def answer(model, **inputs):
    """What onnxruntime makes of an ONNX model."""
    runtime = pytest.importorskip("onnxruntime")
    session = runtime.InferenceSession(model, providers=["CPUExecutionProvider"])
    return session.run(None, {name: value.numpy() for name, value in inputs.items()})[0]


def images(architecture, count=3):
    """Inputs like those of moulds, and numbers of cells."""
    torch.manual_seed(7)
    inputs = torch.rand(count, len(INPUTS), architecture.pixels, architecture.pixels) * 2 - 1
    inputs[:, IMAGES:] = inputs[:, IMAGES:, :1, :1]
    return inputs, torch.full((count,), 500.0)


def assert_same(surrogate, exported):
    """Whether the networks of a surrogate answer alike in ONNX and in torch."""
    inputs, cells = images(surrogate.architecture)
    feeds = {"inputs": inputs, "cells": cells}
    if surrogate.architecture.noise:
        feeds["noise"] = torch.randn(len(cells), surrogate.architecture.noise)
    for number, member in enumerate(surrogate.members):
        with torch.no_grad():
            expected = member(*feeds.values()).numpy()
        assert np.abs(answer(exported.model(number), **feeds) - expected).max() < 1e-4


def test_the_shipped_networks_answer_as_in_torch():
    surrogate = raptor.load_surrogate()
    assert_same(surrogate, export_networks(surrogate))


def test_a_network_that_samples_answers_as_in_torch_and_its_images_are_refined():
    surrogate = untrained("film_unet", noise=4)
    exported = export_networks(surrogate)
    assert_same(surrogate, exported)
    coarse = block_average(torch.rand(3, 64, 64), 32)
    refined = answer(exported.refine, images=coarse)
    assert np.abs(refined - deconvolve(coarse, 64).numpy()).max() < 1e-4


def test_a_network_that_onnx_lacks_is_named():
    pytest.importorskip("neuralop")
    with pytest.raises(RaptorError, match="fno cannot be written as ONNX"):
        export_networks(untrained("fno"))


def test_missing_packages_are_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxscript", None)
    with pytest.raises(RaptorError, match=r"install raptor-tissue\[designer\]"):
        export_networks(untrained("film_unet"))
