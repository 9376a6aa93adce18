"""Prediction by an ensemble of networks: from a mould and parameters to the eight fields."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import interpolate

from raptor.core.errors import RaptorError
from raptor.dataset.scaling import Scaling, scale_inputs
from raptor.fields.metrics import without_sign
from raptor.fields.resample import coarse_images, deconvolve
from raptor.fields.shape import shape_ratios
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters
from raptor.raster import density_threshold
from raptor.surrogate.bands import Calibration
from raptor.surrogate.constraints import project, with_sign
from raptor.surrogate.ensemble import Ensemble, Realisations, full_fields, limits
from raptor.surrogate.generator import Generator
from raptor.surrogate.out_of_distribution import descriptors
from raptor.surrogate.prediction import Prediction
from raptor.surrogate.rules import Architecture
from raptor.symmetry import FIELDS, Element, apply, move_pixels

BATCH = 16
"""Images that a network sees at once."""


@dataclass(frozen=True)
class Surrogate:
    """Trained networks with all that is needed to use them without their data set.

    Parameters
    ----------
    members : tuple of Generator
        Trained alike with different seeds; predictions are their mean.
    layers : int
        Of the tissues that they were trained on.
    pixels : int
        Side of the predicted images; networks may work on block averages of these.
    calibration : Calibration or None
        Calibration of the errors, if measured.
    """

    members: tuple[Generator, ...]
    architecture: Architecture
    scaling: Scaling
    layers: int
    pixels: int
    calibration: Calibration | None = None

    def __post_init__(self) -> None:
        for member in self.members:  # channels last: convolutions take a quarter less time
            member.eval().to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    @cached_property
    def threshold(self) -> float:
        """Density per pixel above which there is tissue in a mean: the simulations' threshold, calibrated."""
        factor = 1.0 if self.calibration is None else self.calibration.threshold_factor
        return factor * density_threshold(self.layers, self.pixels)

    @property
    def own_threshold(self) -> float:
        """The same in realisations: in each sample, or in each network's mean."""
        factor = 1.0 if self.calibration is None else self.calibration.own_factor
        return factor * density_threshold(self.layers, self.pixels)

    @property
    def weights(self) -> int:
        """Number of trained weights of one network."""
        return sum(parameter.numel() for parameter in self.members[0].parameters())

    def cast(self, mould: Mould | CastMould) -> CastMould:
        """A mould cast like the tissues that the networks learnt; one already so cast is returned as is.

        Raises
        ------
        RaptorError
            If a cast mould has other layers or pixels.
        """
        if isinstance(mould, Mould):
            return CastMould(mould, self.layers, self.pixels)
        if (mould.layers, mould.pixels) != (self.layers, self.pixels):
            raise RaptorError(
                f"{mould.mould.name} is cast with {mould.layers} layers and {mould.pixels} pixels; this "
                f"model is for {self.layers} layers and {self.pixels} pixels"
            )
        return mould

    def predict(
        self, mould: Mould | CastMould, cells: Sequence[CellParameters], *, averaged: bool = True
    ) -> NDArray[np.float32]:
        """Fields (n, 8, y, x) in physical units of one mould at n sets of parameters.

        They obey the physics (`surrogate.constraints`).

        Parameters
        ----------
        averaged : bool
            Over the eight images of D4, so that rotating the mould rotates the prediction.
            (sxsz, sysz) have no sign of their own.

        Raises
        ------
        RaptorError
            If the mould holds no cell, or parameters are out of the range that was sampled.
        """
        cast = self.cast(mould)
        elements = Element.all() if averaged else Element.all()[:1]
        fields = np.empty((len(cells), len(FIELDS), self.pixels, self.pixels), np.float32)
        for start in range(0, len(cells), BATCH):
            answers = self._answers(cast, cells[start : start + BATCH], elements)
            fields[start : start + BATCH] = self._finish(_mean(answers.flatten(1, 2)), cast)
        return fields

    def examine(self, mould: Mould | CastMould, parameters: CellParameters) -> Prediction:
        """Predict a mould's tissue with calibrated bands and its distance from the training set.

        Raises
        ------
        RaptorError
            As `predict`, and if the surrogate is not calibrated.
        """
        cast, calibration = self.cast(mould), self.require_calibration()
        found = self.ensemble(cast, parameters)
        measures, deviations, held = found.realisations.measure(self.own_threshold)
        point = descriptors(cast.depression, cast.tethers, parameters)
        return Prediction(
            cast,
            parameters,
            found.mean,
            measures,
            held,
            calibration.fields.bands(found.deviation, np.abs(found.mean[:1])),
            calibration.measures.bands(deviations, np.ones(len(measures))),
            found.answers,
            calibration.relative_disagreement(found.deviation, found.mean),
            calibration.training.distance(point),
            self.threshold,
            calibration.training.unusual(point),
        )

    def ensemble(self, mould: Mould | CastMould, parameters: CellParameters) -> Ensemble:
        """Mean and standard deviation of the fields, and realisations.

        Raises
        ------
        RaptorError
            As `predict`.
        """
        cast = self.cast(mould)
        (answers,) = self._answers(cast, [parameters], Element.all())
        each = answers.flatten(0, 1)
        mean = _mean(each[None])
        (full,) = self._finish(mean, cast)
        magnitudes = without_sign(each)
        # torch's own std along the first axis takes ten times as long.
        coarse = (magnitudes - magnitudes.mean(0)).square().sum(0).div(len(each) - 1).sqrt()
        (fine,) = interpolate(coarse[None], size=2 * (self.pixels,), mode="bilinear").numpy()
        sampled = self.architecture.noise > 0
        scattered = torch.cat([mean, each if sampled else _mean(answers)]).numpy()
        return Ensemble(full, fine, each.numpy(), Realisations.of(cast, scattered, sampled=sampled))

    def sample(
        self, mould: Mould | CastMould, parameters: CellParameters, count: int = 8, seed: int = 0
    ) -> NDArray[np.float32]:
        """Samples (count, 8, y, x) of one mould's tissue in physical units, each a possible simulation.

        The networks take turns; every sample has its own noise and image of D4.

        Raises
        ------
        RaptorError
            As `predict`, and if the networks give one mean.
        """
        self.require_samples()
        cast, stream = self.cast(mould), torch.Generator().manual_seed(seed)
        elements = [Element.from_index(int(n)) for n in torch.randint(8, (count,), generator=stream)]
        inputs, cells = self._inputs(cast, [parameters], self._images(cast, elements))
        scaled = torch.empty(count, len(FIELDS), *inputs.shape[2:])
        with torch.no_grad():
            for number, member in enumerate(self.members):
                own = slice(number, None, len(self.members))
                scaled[own] = member.answers(inputs[own], cells[own], 1, stream)[:, 0]
        fields = torch.from_numpy(self.scaling.inverse(scaled.numpy()))
        back = torch.stack([apply(f, e.inverse) for f, e in zip(fields, elements, strict=True)])
        return full_fields(back.numpy(), cast)

    def require_calibration(self) -> Calibration:
        """The calibration; raises a RaptorError if there is none."""
        if self.calibration is None:
            raise RaptorError(
                "this model's errors were not calibrated, so it cannot give error bands; "
                "use a model written by the workflow's rule assemble_model"
            )
        return self.calibration

    def require_samples(self) -> None:
        """Raise a RaptorError if the networks give one mean."""
        if not self.architecture.noise:
            raise RaptorError("this model gives one mean, not samples; use one with the key noise above 0")

    def ratios(self, density: NDArray[np.floating], cast: CastMould) -> NDArray[np.float64]:
        """A/A0 and w/w0 (2,) of a predicted density (y, x)."""
        return shape_ratios(density, cast, self.threshold)

    def noise(self, images: int) -> list[Tensor]:
        """Of each network, noise (images, numbers) for as many images: the same in every prediction.

        That of the second half is opposite to the first's, which brings the mean of few samples nearer to
        that of many (antithetic variates).
        """
        stream, numbers = torch.Generator().manual_seed(0), self.architecture.noise
        halves = [torch.randn(-(-images // 2), numbers, generator=stream) for _ in self.members]
        return [torch.cat([half, -half])[:images] for half in halves]

    def _images(self, cast: CastMould, elements: Sequence[Element]) -> list[NDArray[np.float32]]:
        """What networks see (3, y', x') of a mould's images under D4."""
        seen = coarse_images(cast, self.architecture.pixels)
        return [np.ascontiguousarray(move_pixels(seen, element)) for element in elements]

    def _inputs(
        self, cast: CastMould, cells: Sequence[CellParameters], images: Sequence[NDArray[np.float32]]
    ) -> tuple[Tensor, Tensor]:
        """Scaled inputs (n * images, 6, y', x') and numbers of cells."""
        for parameters in cells:
            parameters.require_sampled("prediction")
        inputs = torch.from_numpy(np.stack([scale_inputs(image, p) for p in cells for image in images]))
        # Fields are per pixel of the full raster; the networks give their block averages.
        return inputs, torch.full((len(inputs),), cast.n_cells * (images[0].shape[-1] / self.pixels) ** 2)

    def _answers(
        self, cast: CastMould, cells: Sequence[CellParameters], elements: Sequence[Element]
    ) -> Tensor:
        """Prediction of each network for each image under D4, moved back: (n, members, elements, 8, y', x').

        In physical units, on the networks' raster. Networks that sample give one sample of each, with the
        same noise for every set of parameters, so that predictions change smoothly with these.
        """
        images = self._images(cast, elements)
        places, noise = list(range(len(images))), self.noise(len(images))
        if not self.architecture.noise:  # of images that repeat, as a symmetric mould's do, one is enough
            numbers: dict[bytes, int] = {}
            places = [numbers.setdefault(image.tobytes(), len(numbers)) for image in images]
            images, noise = [images[places.index(n)] for n in range(len(numbers))], self.noise(len(numbers))
        inputs, counts = self._inputs(cast, cells, images)
        with torch.no_grad():
            scaled = [
                torch.cat([member(*part) for part in _parts(inputs, counts, own.repeat(len(cells), 1))])
                for member, own in zip(self.members, noise, strict=True)
            ]
        fields = torch.from_numpy(self.scaling.inverse(torch.stack(scaled, dim=1).numpy()))
        fields = fields.reshape(len(cells), len(images), *fields.shape[1:])[:, places]
        back = [apply(fields[:, number], element.inverse) for number, element in enumerate(elements)]
        return torch.stack(back, dim=2)

    def _finish(self, means: Tensor, cast: CastMould) -> NDArray[np.float32]:
        """Fields (n, 8, y, x) at full resolution from means (n, 8, y', x') of magnitudes."""
        return self._obey(with_sign(deconvolve(means, self.pixels)), cast)

    def _obey(self, fields: Tensor, cast: CastMould) -> NDArray[np.float32]:
        """Fields (n, 8, y, x) at full resolution, projected onto the constraints unless they obey them."""
        if self.members[0].physical is None or self.architecture.pixels != self.pixels:
            fields = project(fields, *limits(cast))
        return np.asarray(fields.numpy())


def _parts(inputs: Tensor, counts: Tensor, noise: Tensor) -> Iterator[tuple[Tensor, Tensor, Tensor | None]]:
    """Batches of inputs, numbers of cells and noise, None of networks without."""
    for part, cells, own in zip(*(torch.split(each, BATCH) for each in (inputs, counts, noise)), strict=True):
        yield part, cells, own if own.shape[1] else None


def _mean(answers: Tensor) -> Tensor:
    """Means (n, 8, y, x) over answers (n, answers, 8, y, x), of magnitudes where the sign is spontaneous.

    D4 moves magnitudes like any image; `constraints.with_sign` gives signs back.
    """
    return without_sign(answers).mean(1)
