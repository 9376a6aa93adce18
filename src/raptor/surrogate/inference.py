"""Prediction: from a mould and parameters to the eight fields, and how far to trust them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import interpolate

from raptor.core.errors import RaptorError
from raptor.dataset.scaling import Scaling, scale_inputs
from raptor.fields.metrics import without_sign
from raptor.fields.resample import block_average, deconvolve
from raptor.fields.shape import shape_ratios
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters
from raptor.raster import density_threshold
from raptor.surrogate.bands import Bands, Calibration
from raptor.surrogate.constraints import average, project, signed
from raptor.surrogate.generator import Generator
from raptor.surrogate.out_of_distribution import descriptors
from raptor.surrogate.rules import Architecture
from raptor.symmetry import FIELDS, Element, apply, move_pixels

BATCH = 16


@dataclass(frozen=True)
class Prediction:
    """One tissue, predicted.

    Parameters
    ----------
    fields : ndarray (8, y, x)
        In physical units, per pixel.
    shape : ndarray (2,)
        A/A0 and w/w0.
    field_bands : Bands
        Half widths (levels, 8, y, x) of the calibrated bands about the fields.
    shape_bands : Bands
        Half widths (levels, 2) of those about A/A0 and w/w0.
    disagreement, distance : float
        How far the networks disagree, and how far the input is from the training set, both over what all but
        a hundredth of the validation samples stay below.
    threshold : float
        Density per pixel above which there is tissue in these fields.
    """

    fields: NDArray[np.float32]
    shape: NDArray[np.float64]
    field_bands: Bands
    shape_bands: Bands
    disagreement: float
    distance: float
    threshold: float

    @property
    def unlike(self) -> bool:
        """Whether the input is unlike the training set, or the networks disagree more than they should."""
        return bool(max(self.disagreement, self.distance) > 1)


@dataclass(frozen=True)
class Surrogate:
    """Trained networks with what is needed to use them without their data set.

    Parameters
    ----------
    members : tuple of Generator
        Trained alike, from seeds of their own; predictions are their mean.
    pixels : int
        Side of the images that are predicted, of which networks may see means over squares.
    calibration : Calibration or None
        How errors follow from the spread of the members, where that was measured.
    """

    members: tuple[Generator, ...]
    architecture: Architecture
    scaling: Scaling
    layers: int
    pixels: int
    calibration: Calibration | None = None

    @cached_property
    def threshold(self) -> float:
        """Predicted density per pixel above which there is tissue: the simulated one's, calibrated."""
        edge = 1.0 if self.calibration is None else self.calibration.edge
        return edge * density_threshold(self.layers, self.pixels)

    @property
    def weights(self) -> int:
        """Numbers that training chose, of one member."""
        return sum(parameter.numel() for parameter in self.members[0].parameters())

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
        masks = self._masks(depression, tethers, parameters)
        fine = np.empty((len(parameters), len(FIELDS), self.pixels, self.pixels), np.float32)
        for start in range(0, len(parameters), BATCH):
            part = parameters[start : start + BATCH]
            images = self._images(masks, part, cells, averaged)
            fine[start : start + BATCH] = self._fine(_means(images), masks, cells).numpy()
        return fine

    def predict_mould(
        self, mould: Mould | CastMould, parameters: CellParameters, *, averaged: bool = True
    ) -> NDArray[np.float32]:
        """Fields (8, y, x) of a mould at one set of parameters.

        Raises
        ------
        RaptorError
            As `predict`, and where the mould holds no cell.
        """
        cast = self.cast(mould)
        fields = self.predict(cast.depression, cast.tethers, [parameters], cast.n_cells, averaged=averaged)
        return np.asarray(fields[0])

    def examine(self, mould: Mould | CastMould, parameters: CellParameters) -> Prediction:
        """Predict a mould's tissue with its calibrated bands, and say whether it is unlike the training set.

        Raises
        ------
        RaptorError
            As `predict_mould`, and where the surrogate is not calibrated.
        """
        if self.calibration is None:
            raise RaptorError(
                "this model's errors were not calibrated, so it cannot say how far to trust a prediction; "
                "use the model that the workflow's rule assemble_model wrote"
            )
        cast = self.cast(mould)
        fields, spread, of_members = self.ensemble(cast, parameters)
        shapes = np.array([self.shape(density, cast) for density in of_members])
        calibration = self.calibration
        seen = descriptors(cast.depression, cast.tethers, parameters)
        return Prediction(
            fields,
            self.shape(fields[0], cast),
            calibration.fields.bands(spread, np.abs(fields[:1])),
            calibration.shapes.bands(deviation(shapes), np.ones(2)),
            calibration.disagreement_of(spread, fields),
            calibration.novelty.distance(seen),
            self.threshold,
        )

    def ensemble(
        self, cast: CastMould, parameters: CellParameters
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """Mean fields (8, y, x), their spread over members and images, and members' densities (n, y, x)."""
        masks = self._masks(cast.depression, cast.tethers, [parameters])
        images = self._images(masks, [parameters], cast.n_cells, averaged=True)[0]
        of_members = images.reshape(len(self.members), -1, *images.shape[1:])
        means = torch.cat([_means(images[None]), _means(of_members)])
        fine = self._fine(means, masks, cast.n_cells).numpy()
        spread = without_sign(images).std(dim=0, correction=1)
        wide = interpolate(spread[None], size=2 * (self.pixels,), mode="bilinear")[0].numpy()
        return fine[0], wide, fine[1:, 0]

    def cast(self, mould: Mould | CastMould) -> CastMould:
        """A mould with as many layers and pixels as the networks know; one that is cast stays as it is."""
        return CastMould(mould, self.layers, self.pixels) if isinstance(mould, Mould) else mould

    def shape(self, density: NDArray[np.floating], cast: CastMould) -> NDArray[np.float64]:
        """A/A0 and w/w0 (2,) of a predicted density (y, x)."""
        return shape_ratios(density, cast, self.threshold)

    def _masks(
        self, depression: NDArray[Any], tethers: NDArray[Any], parameters: Sequence[CellParameters]
    ) -> Tensor:
        """Both masks as one tensor (2, y, x), parameters and sizes being allowed."""
        if depression.shape != (self.pixels, self.pixels):
            raise RaptorError(
                f"masks are {depression.shape}; this model takes {self.pixels} x {self.pixels} pixels"
            )
        for values in parameters:
            values.require_sampled("prediction")
        return torch.from_numpy(np.stack([depression, tethers]).astype(np.float32))

    def _images(
        self, masks: Tensor, parameters: Sequence[CellParameters], cells: int, averaged: bool
    ) -> Tensor:
        """What each member says of each image under D4, moved back: (n, members * images, 8, y', x').

        In physical units, on the raster that networks see.
        """
        seen = self.architecture.pixels
        elements = Element.all() if averaged else Element.all()[:1]
        coarse = block_average(masks, seen)
        moved = [move_pixels(coarse, element).numpy() for element in elements]
        scaled_inputs = [
            scale_inputs(depression, tethers, values)
            for values in parameters
            for depression, tethers in moved
        ]
        inputs = torch.from_numpy(np.stack(scaled_inputs))
        # Fields are in the unit of a fine pixel, of which a coarse one is the mean.
        counts = torch.full((len(inputs),), cells * (seen / self.pixels) ** 2)
        answers = []
        with torch.no_grad():
            for member in self.members:
                member.eval()
                parts = zip(torch.split(inputs, BATCH), torch.split(counts, BATCH), strict=True)
                scaled = torch.cat([member(*part) for part in parts]).float()
                fields = torch.from_numpy(self.scaling.inverse(scaled.numpy()))
                of_each = fields.reshape(len(parameters), len(elements), *fields.shape[1:])
                back = [apply(of_each[:, i], element.inverse) for i, element in enumerate(elements)]
                answers.append(torch.stack(back, dim=1))
        return torch.cat(answers, dim=1)

    def _fine(self, means: Tensor, masks: Tensor, cells: int) -> Tensor:
        """Fields (n, 8, y, x) of the whole raster, obeying the physics, from means (n, 8, y', x')."""
        fields = signed(deconvolve(means, self.pixels))
        if self.members[0].physical is not None and self.architecture.pixels == self.pixels:
            return fields
        depression = masks[:1].expand(len(fields), 1, -1, -1)
        return project(fields, depression, torch.full((len(fields),), float(cells)))


def _means(images: Tensor) -> Tensor:
    """Means (n, 8, y, x) of predictions (n, images, 8, y, x) of each of n tissues."""
    return torch.stack([average(of_each) for of_each in images])


def deviation(shapes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviation (2,) over members (n, 2); 0 of a single one."""
    if len(shapes) < 2:
        return np.zeros(2)
    return np.asarray(np.nan_to_num(shapes.std(axis=0, ddof=1)))
