from typing import get_args

import numpy as np
import pandas as pd
import pytest
import shapely
import torch
from pydantic import ValidationError

from raptor.core.errors import RaptorError
from raptor.dataset.examples import list_examples, training_scaling
from raptor.dataset.scaling import INPUTS, Scaling
from raptor.dataset.stack import read_table
from raptor.fields.shape import shape_ratios
from raptor.moulds import Mould, moulds_by_id
from raptor.moulds.cast import CastMould
from raptor.parameters import CellParameters
from raptor.surrogate.batches import split_examples
from raptor.surrogate.constraints import CELL_TENSION
from raptor.surrogate.ensemble import full_density
from raptor.surrogate.files import load, save
from raptor.surrogate.generator import Generator
from raptor.surrogate.inference import Surrogate
from raptor.surrogate.learner import LOSSES, Learner
from raptor.surrogate.losses import (
    FAIR,
    adversarial_loss,
    almost_fair_score,
    balanced,
    discriminator_loss,
    reconstruction_loss,
    sample_loss,
)
from raptor.surrogate.networks import NETWORKS, Discriminator
from raptor.surrogate.networks.blocks import FilmNorm
from raptor.surrogate.rules import Architecture, ModelRules, TrainingRules
from raptor.surrogate.training import SETTLING, joined, train

BOX = Mould(shapely.box(-10, -5, 10, 5))
SCALING = Scaling((0.0,) * 8, (1.0,) * 8)


@pytest.mark.parametrize("pixels", [16, 64, 256])
def test_the_networks_take_any_power_of_two(pixels):
    inputs, fields = torch.zeros(2, len(INPUTS), pixels, pixels), torch.zeros(2, 8, pixels, pixels)
    for network in NETWORKS:
        generator = Generator(Architecture(network=network, pixels=pixels, base_channels=4), SCALING)
        assert generator(inputs, torch.ones(2)).shape == fields.shape
    assert Discriminator(pixels, 4)(inputs, fields).shape[:2] == (2, 1)


def test_an_architecture_names_the_networks_there_are():
    assert set(get_args(Architecture.model_fields["network"].annotation)) == set(NETWORKS)
    with pytest.raises(ValidationError, match="pixels"):
        Architecture(pixels=100)
    assert ModelRules(pixels=64).architecture(32).pixels == 32


@pytest.mark.parametrize(("pixels", "patch"), [(256, 70), (64, 16)])
def test_the_discriminator_sees_patches_as_large_a_part_as_published(pixels, patch):
    discriminator = Discriminator(pixels, 4).eval()
    fields = torch.zeros(1, 8, pixels, pixels, requires_grad=True)
    logits = discriminator(torch.zeros(1, len(INPUTS), pixels, pixels), fields)
    logits[0, 0, 15, 15].backward()
    rows = fields.grad.abs().sum(dim=(0, 1, 3)).nonzero()
    assert int(rows.max() - rows.min()) + 1 == patch


def test_pix2pix_of_the_published_size_has_its_54_million_weights():
    generator = Generator(Architecture(network="pix2pix", pixels=256, base_channels=64), SCALING)
    assert sum(p.numel() for p in generator.parameters()) == pytest.approx(54.4e6, rel=0.01)


def test_losses():
    sure, unsure = torch.full((1, 1, 3, 3), 20.0), torch.zeros(1, 1, 3, 3)
    fields = torch.zeros(1, 8, 4, 4)
    assert float(reconstruction_loss(fields + 0.5, fields, signed=True)) == pytest.approx(0.5)
    assert float(reconstruction_loss(fields - 0.5, fields + 0.5, signed=True)) == pytest.approx(1.0)
    assert float(reconstruction_loss(fields - 0.5, fields + 0.5, signed=False)) == pytest.approx(0.75)
    assert float(adversarial_loss(sure)) == pytest.approx(0, abs=1e-6)
    assert float(discriminator_loss(sure, -sure)) == pytest.approx(0, abs=1e-6)
    assert float(discriminator_loss(unsure, unsure)) == pytest.approx(np.log(2))


def test_the_score_of_samples_is_the_almost_fair_crps():
    """Against the formula of Lang et al. (2024) written out, with numbers as fields."""
    rng = torch.Generator().manual_seed(0)
    samples, target = torch.randn(5, 3, generator=rng), torch.randn(5, generator=rng)
    found = almost_fair_score(samples, target, torch.abs)
    for row, x, y in zip(found.tolist(), samples.tolist(), target.tolist(), strict=True):
        error = np.mean([abs(each - y) for each in x])
        between = sum(abs(a - b) for a in x for b in x)
        fair, plain = error - between / (2 * 3 * 2), error - between / (2 * 3 * 3)
        assert row == pytest.approx(FAIR * fair + (1 - FAIR) * plain, abs=1e-6)


def test_samples_of_the_right_distribution_score_best():
    rng = torch.Generator().manual_seed(0)
    target, noise = torch.randn(4000, 8, 8, 8, generator=rng), torch.randn(4000, 2, 8, 8, 8, generator=rng)
    right = float(sample_loss(noise, target))
    for wrong in (0 * noise, 0.6 * noise, 1.6 * noise, noise + 0.4):
        assert float(sample_loss(wrong, target)) > right
    # What is the same all over an image: samples of each pixel by itself are not.
    alike, smooth = target[..., :1, :1].expand_as(target), noise[..., :1, :1].expand_as(noise)
    assert float(sample_loss(noise, alike)) > float(sample_loss(smooth, alike))


def test_tension_counts_alike_at_small_and_large_delta():
    delta = torch.tensor([0.1, 0.9])
    fields = torch.ones(2, 8, 4, 4)
    fields[:, 1] = delta[:, None, None] ** 2
    even = balanced(fields, delta)
    assert even[0, 1, 0, 0] == pytest.approx(0.01 / 0.03)
    assert even[1, 1, 0, 0] == pytest.approx(0.81 / 0.83)
    assert (even[:, [0, *range(2, 8)]] == 1).all()
    samples = fields[:, None].expand(-1, 3, -1, -1, -1)
    assert torch.equal(balanced(samples, delta)[:, 2], even)


def test_a_network_with_noise_learns_to_say_either_of_two_outcomes():
    """At least half of the samples are near 1 or -1, and both signs are among them, in most trainings."""
    assert sum(_says_either(seed) for seed in range(6)) >= 4


def _says_either(seed):
    architecture = Architecture(pixels=16, base_channels=4, noise=4)
    of_a_cell = CELL_TENSION * 0.5**2  # the middle of Delta, which inputs of zero stand for
    scaling = Scaling(SCALING.offset, (1.0, of_a_cell, *SCALING.scale[2:]))
    rules = TrainingRules(epochs=200, learning_rate=3e-3)
    learner = Learner(architecture, scaling, rules, seed, torch.device("cpu"))
    inputs = torch.zeros(16, len(INPUTS), 16, 16)
    inputs[:, 0] = 1.0
    target = torch.zeros(16, 8, 16, 16)
    target[:, 0] = target[:, 4] = 1.0
    target[:8, 1], target[8:, 1] = 1.0, -1.0  # tension of either sign
    for epoch in range(2):
        if epoch == 1:
            learner.keep_moments()
        learner.start_epoch(epoch)
        for _ in range(75):
            learner.step(inputs, target)
    learner.generator.eval()
    stream = torch.Generator().manual_seed(1)
    with torch.no_grad():
        answers = learner.generator.answers(inputs[:1], torch.tensor([256.0]), 64, stream)[0, :, 1]
    means = answers.mean((1, 2))
    return (means.abs() > 0.5).float().mean() > 0.5 and means.min() < -0.5 and means.max() > 0.5


def moulds_of(made):
    return moulds_by_id(made / "moulds.geojson")


@pytest.fixture
def training(made, tmp_path):
    stack = made / "fields.nc"
    pix2pix = {"network": "pix2pix", "base_channels": 4, "lambda_l1": 100.0}

    def run(epochs, name, identity="a", initial_weights=None, **changes):
        rules = ModelRules(**pix2pix | {"epochs": epochs} | changes)
        scaling, splits = training_scaling(stack), read_table(stack).split
        return train(
            *split_examples([stack], list_examples(stack), splits, moulds_of(made), scaling, 32),
            rules.architecture(32),
            rules, seed=0, checkpoint=tmp_path / name, identity=identity, initial_weights=initial_weights,
        )  # fmt: skip

    return run


def same_weights(a, b):
    theirs = b.generator.state_dict()
    return all(torch.equal(value, theirs[name]) for name, value in a.generator.state_dict().items())


def learnt(trained):
    losses = trained.history["reconstruction_loss"]
    return losses.iloc[-1] < losses.iloc[0]


def test_training_learns_and_is_repeatable(training):
    a, b = training(4, "a.pt"), training(4, "b.pt")
    assert learnt(a)
    assert same_weights(a, b)


def test_normalisation_rests_on_many_batches_of_training_examples(training):
    """The moments of the first layer are means over the batches seen at the end, equally weighted."""
    seen = []
    kept = torch.nn.BatchNorm2d.forward

    def spied(self, features):
        if self.momentum is None:
            seen.append((id(self), features.mean((0, 2, 3))))
        return kept(self, features)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(torch.nn.BatchNorm2d, "forward", spied)
        generator = training(1, "settled.pt", network="film_unet", lambda_l1=None, batch_size=2).generator
    first = next(module for module in generator.modules() if isinstance(module, torch.nn.BatchNorm2d))
    means = torch.stack([mean for number, mean in seen if number == id(first)])
    assert len(means) == int(first.num_batches_tracked) == SETTLING
    assert torch.allclose(first.running_mean, means.mean(0), atol=1e-5)


def test_training_goes_on_from_the_weights_of_another(training):
    begun = training(3, "begun.pt")
    weights = begun.generator.state_dict()
    still = training(1, "still.pt", "b", weights, learning_rate=1e-12)
    for name, value in still.generator.named_parameters():
        assert torch.allclose(value, weights[name], atol=1e-9)
    anew, on = training(1, "anew.pt", "c"), training(1, "on.pt", "d", weights)
    assert on.history["reconstruction_loss"].iloc[0] < anew.history["reconstruction_loss"].iloc[0]
    whole = joined(begun.history, on.history)
    assert whole["epoch"].tolist() == [0, 1, 2, 3]
    assert joined(pd.DataFrame(), on.history)["epoch"].tolist() == [0]


def test_training_in_bfloat16_keeps_float32_weights(training):
    trained = training(2, "half.pt", precision="bfloat16")
    assert learnt(trained)
    dtypes = {value.dtype for value in trained.generator.state_dict().values()}
    assert dtypes == {torch.float32, torch.int64}


@pytest.mark.parametrize("network", ["pix2pix_film", "film_unet", "fno"])
def test_other_networks_learn_without_a_discriminator(training, network):
    trained = training(3, "other.pt", network=network, learning_rate=3e-3, lambda_l1=None)
    assert learnt(trained)
    assert (trained.history["discriminator_loss"] == 0).all()


def test_a_sampler_starts_from_a_network_that_gives_a_mean(training):
    plain = {"network": "film_unet", "lambda_l1": None}
    mean = training(2, "mean.pt", **plain)
    weights = mean.generator.state_dict()
    started = training(1, "started.pt", "b", weights, noise=4, learning_rate=1e-12, **plain)
    assert torch.allclose(
        started.generator.network.stem.convolution.weight, weights["network.stem.convolution.weight"]
    )
    assert learnt(training(12, "sampler.pt", "c", weights, noise=4, **plain))
    with pytest.raises(ValidationError, match="fno has no modulation"):
        ModelRules(network="fno", noise=4)


def test_a_sampler_keeps_its_moments_in_the_second_half(training, monkeypatch):
    """The first half of the steps normalises by the moments of each batch, the second by those of many."""
    used = []
    step = Learner.step

    def spied(self, inputs, target):
        first = self.generator.normalisations()[0]
        before = first.running_mean.clone(), first.training
        losses = step(self, inputs, target)
        used.append((before[1], torch.equal(first.running_mean, before[0])))
        return losses

    monkeypatch.setattr(Learner, "step", spied)
    trained = training(2, "kept.pt", network="film_unet", lambda_l1=None, noise=4)
    half = len(used) // 2
    assert used == [(True, False)] * half + [(False, True)] * half
    assert int(trained.generator.normalisations()[0].num_batches_tracked) == SETTLING


def test_samples_are_outcomes_of_their_own(model_folder):
    with pytest.raises(RaptorError, match="gives one mean"):
        load(model_folder).sample(BOX, CellParameters(0.5, 0.5, 0.3))
    architecture = Architecture(pixels=32, base_channels=4, noise=4)
    members = tuple(Generator(architecture, SCALING) for _ in range(2))
    for member in members:
        torch.nn.init.normal_(member.network.embed.noise.weight)
        for module in member.modules():
            if isinstance(module, FilmNorm):
                torch.nn.init.normal_(module.modulation.weight, 0.0, 0.1)
    surrogate = Surrogate(members, architecture, SCALING, 4, 32)
    found = surrogate.ensemble(BOX, CellParameters(0.5, 0.5, 0.3)).realisations
    densities = full_density(found.densities[1:], found.cast)
    threshold = float(densities.max()) / 4  # these untrained networks spread cells thinly
    estimate, deviations, _ = found.measure(threshold)
    each = [shape_ratios(density, found.cast, threshold) for density in densities]
    assert len(each) == 2 * 8
    assert estimate[:2] == pytest.approx(np.mean(each, axis=0))
    assert deviations[:2] == pytest.approx(np.std(each, axis=0, ddof=1))
    samples = surrogate.sample(BOX, CellParameters(0.5, 0.5, 0.3), 5, seed=3)
    assert samples.shape == (5, 8, 32, 32)
    assert np.array_equal(samples, surrogate.sample(BOX, CellParameters(0.5, 0.5, 0.3), 5, seed=3))
    assert (samples.std(axis=0).max(axis=(1, 2)) > 0).all()
    assert samples[:, 0].sum(axis=(1, 2)) == pytest.approx(surrogate.cast(BOX).n_cells, rel=1e-5)


def test_training_resumed_is_training_undisturbed(training, monkeypatch):
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
    columns = ["epoch", *LOSSES, "validation_error"]
    assert whole.history[columns].equals(resumed.history[columns])
    assert same_weights(whole, resumed)


def test_a_finished_training_is_as_it_was(training):
    """Moments of networks that sample are kept, not taken anew, when a checkpoint holds every epoch."""
    sampler = {"network": "film_unet", "lambda_l1": None, "noise": 2}
    once, again = training(2, "done.pt", **sampler), training(2, "done.pt", **sampler)
    assert same_weights(once, again)


def test_a_checkpoint_of_another_training_or_cut_short_is_ignored(training, tmp_path):
    training(2, "a.pt", "one")
    again = training(2, "a.pt", "two")
    fresh = training(2, "fresh.pt", "two")
    (tmp_path / "a.pt").write_bytes(b"broken")
    after = training(2, "a.pt", "two")
    for other in (again, after):
        assert same_weights(fresh, other)


@pytest.fixture
def model_folder(tmp_path):
    architecture = Architecture(network="pix2pix", pixels=32, base_channels=4)
    surrogate = Surrogate((Generator(architecture, SCALING),), architecture, SCALING, 4, 32)
    save(tmp_path / "model", surrogate, {}, "a")
    return tmp_path / "model"


def test_a_saved_model_predicts_the_same(model_folder):
    surrogate, again = load(model_folder), load(model_folder)
    parameters = [CellParameters(d, 0.5, 0.3) for d in (0.1, 0.9)]
    a = surrogate.predict(BOX, parameters)
    assert a.shape == (2, 8, 32, 32)
    assert np.array_equal(a, again.predict(again.cast(BOX), parameters))
    assert not np.array_equal(a[0], a[1])


def test_weights_that_do_not_fit_and_bad_requests_are_named(model_folder):
    surrogate = load(model_folder)
    for parameters, message in (
        (CellParameters(0.99, 0.5, 0.3), "delta is 0.99; it must lie between 0.05 and 0.95"),
        (CellParameters(0.5, 0.2, 0.3), "kappa_nnnn is 0.3, above kappa_nnn"),
    ):
        with pytest.raises(RaptorError, match=message):
            surrogate.predict(BOX, [parameters])
    with pytest.raises(RaptorError, match="cast with 4 layers and 64 pixels; this model is for"):
        surrogate.predict(CastMould(BOX, 4, 64), [])
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


def test_weights_of_networks_that_see_other_images_are_refused(model_folder):
    text = (model_folder / "model.json").read_text()
    (model_folder / "model.json").write_text(text.replace('"as_cast",', ""))
    with pytest.raises(
        RaptorError, match=r"trained by another version.* do not see .*as_cast.*train it again"
    ):
        load(model_folder)


def test_half_of_the_samples_have_opposite_noise():
    architecture = Architecture(pixels=32, base_channels=4, noise=4)
    members = tuple(Generator(architecture, SCALING) for _ in range(2))
    surrogate = Surrogate(members, architecture, SCALING, 4, 32)
    for own in surrogate.noise(8):
        assert own.shape == (8, 4)
        assert torch.equal(own[:4], -own[4:])
    assert not torch.equal(*surrogate.noise(8))
    assert surrogate.noise(3)[0].shape == (3, 4)
