from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import shapely
import torch

from raptor.core.errors import RaptorError
from raptor.dataset.examples import augment, training_scaling
from raptor.dataset.loader import ExampleSet
from raptor.dataset.scaling import Scaling
from raptor.dataset.stack import read_table
from raptor.moulds import Mould, mould_image
from raptor.parameters import CellParameters
from raptor.surrogate.batches import Feeder
from raptor.surrogate.files import load, save
from raptor.surrogate.losses import discriminator_loss, generator_loss, relative_distance
from raptor.surrogate.networks import Architecture, Discriminator, Generator, initialise
from raptor.surrogate.training import TrainingRules, joined, train

BOX = Mould(shapely.box(-10, -5, 10, 5))
SCALING = Scaling((0.0,) * 8, (1.0,) * 8)


@pytest.mark.parametrize("pixels", [16, 64, 128, 256])
def test_the_networks_take_any_power_of_two(pixels):
    architecture = Architecture(pixels, 4)
    inputs, fields = torch.zeros(2, 5, pixels, pixels), torch.zeros(2, 8, pixels, pixels)
    assert Generator(architecture, SCALING)(inputs, torch.ones(2)).shape == fields.shape
    for network in ("modulated", "compact", "fno"):
        other = Generator(Architecture(pixels, 4, network=network), SCALING)
        assert other(inputs, torch.ones(2)).shape == fields.shape
    for layers in (1, 3, 5):
        assert Discriminator(Architecture(pixels, 4, 0.5, layers))(inputs, fields).shape[:2] == (2, 1)
    with pytest.raises(RaptorError, match="power of two"):
        Architecture(pixels + 1, 4)


def test_the_discriminator_sees_patches_of_seventy_pixels():
    discriminator = Discriminator(Architecture(256, 4)).eval()
    fields = torch.zeros(1, 8, 256, 256, requires_grad=True)
    logits = discriminator(torch.zeros(1, 5, 256, 256), fields)
    logits[0, 0, 15, 15].backward()
    rows = fields.grad.abs().sum(dim=(0, 1, 3)).nonzero()
    assert int(rows.max() - rows.min()) + 1 == 70


def test_pix2pix_of_the_published_size_has_its_54_million_weights():
    generator = Generator(Architecture(256, 64), SCALING)
    assert sum(p.numel() for p in generator.parameters()) == pytest.approx(54.4e6, rel=0.01)


def test_the_relative_distance_counts_each_field_of_each_sample_alike():
    generator = torch.Generator().manual_seed(0)
    target = torch.randn(3, 8, 16, 16, generator=generator)
    sizes = torch.tensor([1.0, 100.0, 0.01])[:, None, None, None] * torch.logspace(-3, 3, 8)[:, None, None]
    assert float(relative_distance(target, target)) < 1e-4
    alike = relative_distance(torch.zeros_like(target), target)
    assert float(alike) == pytest.approx(1 / np.sqrt(1.1), rel=0.02)
    loud = relative_distance(0 * target[:1], target[:1] * sizes[:1])
    assert float(loud) == pytest.approx(float(alike), rel=0.02)


def test_losses():
    sure, unsure = torch.full((1, 1, 3, 3), 20.0), torch.zeros(1, 1, 3, 3)
    fields = torch.zeros(1, 8, 4, 4)
    loss = generator_loss(sure, fields + 0.5, fields, 100.0)
    assert float(loss.total) == pytest.approx(50.0)
    assert float(discriminator_loss(sure, -sure)) == pytest.approx(0, abs=1e-6)
    assert float(discriminator_loss(unsure, unsure)) == pytest.approx(np.log(2))


@pytest.fixture
def training_rules():
    return TrainingRules(4, 4, 1e-3, 0.5, 100.0, 0, 1)


@pytest.fixture
def training(training_rules, made, tmp_path):
    stack = made / "dataset" / "fields.nc"

    def run(epochs, name, identity="a", begun=None, **changes):
        rules = replace(training_rules, epochs=epochs, **changes)
        return train(
            stack, augment(stack), read_table(stack).split, training_scaling(stack),
            Architecture(32, 4, 0.5), rules, tmp_path / name, identity, begun=begun,
        )  # fmt: skip

    return run


def test_training_learns_and_is_repeatable(training):
    a, b = training(4, "a.pt"), training(4, "b.pt")
    assert a.history["distance"].iloc[-1] < a.history["distance"].iloc[0]
    assert all(torch.equal(a.weights[k], b.weights[k]) for k in a.weights)


def test_training_goes_on_from_the_weights_of_another(training):
    begun = training(3, "begun.pt")
    still = training(1, "still.pt", "b", begun.weights, learning_rate=1e-12)
    learnt = {name for name, _ in Generator(Architecture(32, 4, 0.5), SCALING).named_parameters()}
    for name in learnt:
        assert torch.allclose(still.weights[name], begun.weights[name], atol=1e-9)
    anew, on = training(1, "anew.pt", "c"), training(1, "on.pt", "d", begun.weights)
    assert on.history["distance"].iloc[0] < anew.history["distance"].iloc[0]
    whole = joined(begun.history, on.history)
    assert whole["epoch"].tolist() == [0, 1, 2, 3]
    assert joined(pd.DataFrame(), on.history)["epoch"].tolist() == [0]


def test_training_in_bfloat16_keeps_float32_weights(training_rules, made, tmp_path):
    stack = made / "dataset" / "fields.nc"
    rules = replace(training_rules, epochs=2, precision="bfloat16", deterministic=False)
    trained = train(
        stack, augment(stack), read_table(stack).split, training_scaling(stack), Architecture(32, 4, 0.5),
        rules, tmp_path / "half.pt", "half",
    )  # fmt: skip
    assert trained.history["distance"].iloc[-1] < trained.history["distance"].iloc[0]
    assert {value.dtype for value in trained.weights.values()} == {torch.float32, torch.int64}


def test_examples_kept_on_a_device_are_the_loaders(made):
    stack = made / "dataset" / "fields.nc"
    examples = ExampleSet(stack, augment(stack), training_scaling(stack))
    kept, read = (Feeder(examples, torch.device("cpu"), 0, resident) for resident in (True, False))
    order = torch.randperm(len(examples)).tolist()
    batches = list(zip(kept.batches(order, 5), read.batches(order, 5), strict=True))
    assert sum(len(inputs) for (inputs, _), _ in batches) == len(examples)
    for ours, theirs in batches:
        assert all(torch.equal(a, b) for a, b in zip(ours, theirs, strict=True))


@pytest.mark.parametrize("network", ["modulated", "compact", "fno"])
def test_other_networks_learn_without_a_discriminator(training_rules, made, tmp_path, network):
    stack = made / "dataset" / "fields.nc"
    rules = replace(training_rules, epochs=3, learning_rate=3e-3, adversarial=0.0, loss="relative")
    trained = train(
        stack, augment(stack), read_table(stack).split, training_scaling(stack),
        Architecture(32, 4, network=network), rules, tmp_path / "other.pt", network,
    )  # fmt: skip
    assert trained.history["distance"].iloc[-1] < trained.history["distance"].iloc[0]
    assert (trained.history["discriminator_loss"] == 0).all()


def test_training_resumed_is_training_undisturbed(training, tmp_path, monkeypatch):
    whole = training(4, "whole.pt")
    import raptor.surrogate.training as module

    real, calls = module._train_epoch, []

    def killed(*arguments):
        if len(calls) == 2:
            raise KeyboardInterrupt
        calls.append(1)
        return real(*arguments)

    monkeypatch.setattr(module, "_train_epoch", killed)
    with pytest.raises(KeyboardInterrupt):
        training(4, "resumed.pt")
    monkeypatch.setattr(module, "_train_epoch", real)
    resumed = training(4, "resumed.pt")
    columns = ["epoch", "generator_loss", "distance", "discriminator_loss", "validation_error"]
    assert whole.history[columns].equals(resumed.history[columns])
    assert all(torch.equal(whole.weights[k], resumed.weights[k]) for k in whole.weights)


def test_a_checkpoint_of_another_training_or_cut_short_is_ignored(training, tmp_path):
    training(2, "a.pt", "one")
    again = training(2, "a.pt", "two")
    fresh = training(2, "fresh.pt", "two")
    (tmp_path / "a.pt").write_bytes(b"broken")
    after = training(2, "a.pt", "two")
    for other in (again, after):
        assert all(torch.equal(fresh.weights[k], other.weights[k]) for k in fresh.weights)


@pytest.fixture
def model_folder(tmp_path):
    architecture = Architecture(32, 4)
    generator = initialise(Generator(architecture, SCALING))
    save(tmp_path / "model", [generator.state_dict()], architecture, SCALING, 4, architecture.pixels, {}, "a")
    return tmp_path / "model"


def test_a_saved_model_predicts_the_same(model_folder):
    image = mould_image(BOX, 32)
    surrogate, again = load(model_folder), load(model_folder)
    parameters = [CellParameters(d, 0.5, 0.3) for d in (0.1, 0.9)]
    a = surrogate.predict(image.depression, image.tethers, parameters, 190)
    assert a.shape == (2, 8, 32, 32)
    assert np.array_equal(a, again.predict(image.depression, image.tethers, parameters, 190))
    assert not np.array_equal(a[0], a[1])


def test_weights_that_do_not_fit_and_bad_requests_are_named(model_folder):
    surrogate = load(model_folder)
    masks = np.zeros((32, 32), bool)
    for parameters, message in (
        (CellParameters(0.99, 0.5, 0.3), "delta is 0.99; it must lie between 0.05 and 0.95"),
        (CellParameters(0.5, 0.2, 0.3), "kappa_nnnn is 0.3, above kappa_nnn"),
    ):
        with pytest.raises(RaptorError, match=message):
            surrogate.predict(masks, masks, [parameters], 9)
    with pytest.raises(RaptorError, match="takes 32 x 32"):
        surrogate.predict(masks[1:], masks[1:], [], 9)
    text = (model_folder / "model.json").read_text()
    (model_folder / "model.json").write_text(text.replace('"base_channels": 4', '"base_channels": 8'))
    with pytest.raises(RaptorError, match="does not fit the model"):
        load(model_folder)
    (model_folder / "model.json").write_text(text.replace('"identity": "a"', '"identity": "b"'))
    with pytest.raises(RaptorError, match="two trainings"):
        load(model_folder)
    (model_folder / "weights.safetensors").write_bytes(b"short")
    with pytest.raises(RaptorError, match="cannot be read"):
        load(model_folder)
    (model_folder / "model.json").write_text("{}")
    with pytest.raises(RaptorError, match=r"model.json cannot be read"):
        load(model_folder)
