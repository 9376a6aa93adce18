"""Architecture and training of a model: blocks of configuration keys that the package uses directly."""

from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator

from raptor.core.blocks import Block, Name, Positive

BASELINES = ("nearest", "mean")
"""Predictions without a network: see `surrogate.baselines`."""
SHIPPED = Path(__file__).parent / "shipped"
"""The folder of the model that comes with the package."""


class Architecture(Block):
    """Kind and size of a network."""

    network: Literal["film_unet", "pix2pix", "pix2pix_film", "fno"] = Field(
        "film_unet",
        description="film_unet: a residual U-Net, parameters scaling and shifting its features; pix2pix: "
        "the published U-Net; pix2pix_film: the same with such parameters; fno: a Fourier neural operator",
    )
    pixels: Literal[16, 32, 64, 128, 256, 512] = Field(
        64,
        description="side of the images that the network works on, block averages of the data set's; "
        "those of the data set where they are smaller",
    )
    base_channels: int = Field(16, ge=1, le=256, description="channels of the first layer (pix2pix: 64)")
    noise: int = Field(
        0,
        ge=0,
        le=256,
        description="random numbers that modulate features with the parameters, so that each draw gives "
        "one sample, trained by the CRPS; 0: the network gives one mean",
    )

    @model_validator(mode="after")
    def _can_sample(self) -> Self:
        if self.noise and self.network not in ("film_unet", "pix2pix_film"):
            raise ValueError(f"noise: {self.network} has no modulation; choose film_unet or noise: 0")
        return self


class TrainingRules(Block):
    """How a network is trained.

    pix2pix uses a learning rate of 2e-4 and a discriminator, beside which the L1 distance weighs 100. On a
    few dozen moulds the defaults did better on the validation split.
    """

    lambda_l1: float | None = Field(
        None,
        gt=0,
        description="weight of the L1 distance beside the loss of a discriminator (pix2pix: 100); "
        "null: train without one",
    )
    epochs: Positive = Field(
        120,
        description="passes over the training runs, each in one of its images under D4 and at a place in the "
        "frame, both drawn at random",
    )
    batch_size: int = Field(4, ge=2, description="examples per step")
    learning_rate: float = Field(
        1e-3, gt=0, lt=1, description="of Adam; falls linearly to zero over the second half (pix2pix: 2e-4)"
    )
    precision: Literal["float32", "bfloat16"] = Field(
        "float32", description="of the layers in training; weights, losses and steps are float32"
    )


class ModelRules(TrainingRules, Architecture):
    """A model: an ensemble of networks of one architecture, trained alike with different seeds."""

    ensemble_size: int = Field(2, ge=1, le=32, description="networks whose predictions are averaged")
    initial_weights: Name | None = Field(
        None,
        description="model whose weights training starts from, network by network; null: random weights",
    )

    def architecture(self, pixels: int) -> Architecture:
        """The architecture for a data set whose images have `pixels` per side."""
        own = {name: getattr(self, name) for name in Architecture.model_fields}
        return Architecture.model_validate(own | {"pixels": min(self.pixels, pixels)})

    def training(self) -> TrainingRules:
        """The rules of training alone."""
        return TrainingRules(**{name: getattr(self, name) for name in TrainingRules.model_fields})
