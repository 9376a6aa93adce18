"""What a surrogate says of one tissue: fields, ratios, their bands, and how far to trust them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raptor.moulds.cast import CastMould
from raptor.parameters import CellParameters
from raptor.surrogate.bands import Bands


@dataclass(frozen=True)
class Prediction:
    """One tissue, predicted.

    Parameters
    ----------
    cast : CastMould
        The mould, as cast.
    parameters : CellParameters
    fields : ndarray (8, y, x)
        In physical units, per pixel, in the order `FIELDS`.
    ratios : ndarray (2,)
        A/A0 and w/w0.
    field_bands : Bands
        Half widths (levels, 8, y, x) of the calibrated bands about the fields.
    ratio_bands : Bands
        Half widths (levels, 2) of those about A/A0 and w/w0.
    disagreement : float
        Of the networks about density, over what all but a hundredth of the validation samples stay below.
    distance : float
        From the input to the nearest of the training set, over the same.
    threshold : float
        Density per pixel above which there is tissue in these fields.
    """

    cast: CastMould
    parameters: CellParameters
    fields: NDArray[np.float32]
    ratios: NDArray[np.float64]
    field_bands: Bands
    ratio_bands: Bands
    disagreement: float
    distance: float
    threshold: float

    @property
    def area_ratio(self) -> float:
        """A/A0, area of the tissue over its area as cast."""
        return float(self.ratios[0])

    @property
    def width_ratio(self) -> float:
        """w/w0, width of the tissue on the central section over its width as cast."""
        return float(self.ratios[1])

    @property
    def out_of_distribution(self) -> bool:
        """Whether the input is unlike the training set, or the networks disagree more than they should."""
        return bool(max(self.disagreement, self.distance) > 1)
