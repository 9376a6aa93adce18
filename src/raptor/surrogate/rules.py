"""Architecture and training of a model: blocks of configuration keys that the package uses directly."""

from typing import Literal, Self

from pydantic import Field, model_validator

from raptor.core.blocks import Block, Name, Positive


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

    pix2pix uses a learning rate of 2e-4, beta1 of 0.5, a weight of 100 on the L1 distance and a
    discriminator. On a few dozen moulds the defaults did better on the validation split.
    """

    adversarial: float = Field(
        0.0, ge=0, description="weight of the discriminator's loss; 0: train without one (pix2pix: 1)"
    )
    reconstruction_weight: float = Field(
        1000.0, ge=0, description="weight of the mean absolute error of scaled fields (pix2pix: 100)"
    )
    epochs: Positive = Field(70, description="passes over the augmented examples")
    batch_size: int = Field(4, ge=2, description="examples per step")
    learning_rate: float = Field(
        1e-3, gt=0, lt=1, description="of Adam; falls linearly to zero over the second half (pix2pix: 2e-4)"
    )
    beta1: float = Field(0.9, ge=0, lt=1, description="of Adam (pix2pix: 0.5)")
    precision: Literal["float32", "bfloat16"] = Field(
        "float32", description="of the layers in training; weights, losses and steps are float32"
    )
    threads: Positive = Field(
        1, description="processor threads; trained weights are equal for an equal number"
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
