"""The surrogate's prediction of one tissue, with its error bands."""

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from raptor.fields.directors import alignment, anisotropy
from raptor.fields.labelled import MEASURES, labelled, named
from raptor.fields.tethers import posts_lost, seen_held
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters
from raptor.surrogate.bands import LEVELS, Bands

if TYPE_CHECKING:
    import xarray as xr

WIDEST = 1.96  # standard deviations of a normal error in the widest band


@dataclass(frozen=True)
class Prediction:
    """One tissue, predicted: what `predict` returns.

    Parameters
    ----------
    cast : CastMould
    parameters : CellParameters
        Of the tissue.
    values : ndarray (8, y, x)
        The fields, in the order `symmetry.FIELDS`, per pixel.
    ratios : ndarray (2,)
        A/A0 and w/w0.
    field_bands : Bands
        Half widths (levels, 8, y, x) of the calibrated bands about the fields.
    ratio_bands : Bands
        Half widths (levels, 2) of those about A/A0 and w/w0.
    disagreement : float
        Of the networks about density, over the value that 99 % of the validation samples stay below.
    distance : float
        From the input to the nearest of the training set, likewise.
    threshold : float
        Density per pixel above which there is tissue in these fields.
    most_unusual : str
        The descriptor of the input that is least like the training set's, with its value and their range.
    """

    cast: CastMould
    parameters: CellParameters
    values: NDArray[np.float32]
    ratios: NDArray[np.float64]
    field_bands: Bands
    ratio_bands: Bands
    disagreement: float
    distance: float
    threshold: float
    most_unusual: str

    @property
    def mould(self) -> Mould:
        """The mould that the tissue is predicted in."""
        return self.cast.mould

    @property
    def layers(self) -> int:
        """Cell layers of the simulations that the surrogate was trained on."""
        return self.cast.layers

    @property
    def area_ratio(self) -> float:
        """A/A0."""
        return float(self.ratios[0])

    @property
    def width_ratio(self) -> float:
        """w/w0 of the central section; NaN where it holds no tissue as cast."""
        return float(self.ratios[1])

    @cached_property
    def held(self) -> NDArray[np.float64]:
        """1 where the predicted tissue encloses a tether, else 0, (tethers,): see `tethers.seen_held`."""
        return seen_held(self.values[0], self.cast, self.threshold)

    @property
    def posts_lost(self) -> int:
        """Tethers that the predicted tissue does not enclose."""
        return posts_lost(self.held)

    @property
    def alignment(self) -> float:
        """1 where all cells lie along the mould's long side, -1 across it: see `directors.alignment`."""
        return alignment(self.values, self.cast)

    @property
    def anisotropy(self) -> float:
        """How far cells line up locally, whatever the direction, 0 to 1: see `directors.anisotropy`."""
        return anisotropy(self.values)

    @property
    def area_ratio_band(self) -> tuple[float, float]:
        """Ends of the 95 % band of A/A0."""
        return self._band(0)

    @property
    def width_ratio_band(self) -> tuple[float, float]:
        """Ends of the 95 % band of w/w0."""
        return self._band(1)

    @property
    def out_of_distribution(self) -> bool:
        """Whether the input is unlike the training set, or the networks disagree too much.

        The bands are then meaningless: simulate instead.
        """
        return bool(self.unusual)

    @property
    def unusual(self) -> str:
        """Why the prediction is out of distribution, in words; empty where it is not."""
        if self.distance > 1:
            return self.most_unusual
        if self.disagreement > 1:
            return f"the networks disagree {self.disagreement:.1f} times as much as is usual"
        return ""

    @property
    def fields(self) -> "xr.Dataset":
        """The eight fields (y, x) per pixel, named, with masks, parameters, ratios and the mould.

        See `raptor.fields.labelled` for what the Dataset holds.
        """
        measures = {name: getattr(self, name) for name in (*MEASURES, "held")}
        about = {"method": "prediction", "threshold": self.threshold}
        return labelled(self.values, self.cast, self.parameters, measures, **about)

    @property
    def deviation(self) -> NDArray[np.float32]:
        """Standard deviation (8, y, x) of the fields' error: the half width of the 95 % band over 1.96."""
        return np.asarray(self.field_bands.half[-1] / WIDEST)

    @property
    def numbers(self) -> dict[str, float | int | bool | str | list[float]]:
        """The predicted numbers by name; bands as half widths."""
        half = self.ratio_bands.half[-1]
        return {
            "mould": self.mould.name, **asdict(self.parameters), "layers": self.layers,
            "area_ratio": self.area_ratio, "area_ratio_band95": float(half[0]),
            "width_ratio": self.width_ratio, "width_ratio_band95": float(half[1]),
            "posts_lost": self.posts_lost, "alignment": self.alignment, "anisotropy": self.anisotropy,
            "held": self.held.tolist(),
            "distance": self.distance, "disagreement": self.disagreement,
            "out_of_distribution": self.out_of_distribution,
            "unusual": self.unusual,
        }  # fmt: skip

    def to_dataset(self) -> "xr.Dataset":
        """`fields`, each with its deviation (`density_std`, ...), and the ratios' bands (level,)."""
        fields = self.fields
        share = named("share of simulations that a band covers")
        added: dict[str, Any] = {"level": ("level", list(LEVELS), share)}
        for name, half in zip(("area_ratio", "width_ratio"), self.ratio_bands.half.T, strict=True):
            added[f"{name}_band"] = ("level", half, named(f"half width of the band about {name}"))
        for name in ("disagreement", "distance"):
            text = f"{name}, over its usual value; above 1 do not trust the prediction"
            added[name] = ((), getattr(self, name), named(text))
        deviations = {
            f"{name}_std": (("y", "x"), image, named(f"standard deviation of the error of {name}, per pixel"))
            for name, image in zip(fields, self.deviation, strict=True)
        }
        about = {"unusual": self.unusual} if self.out_of_distribution else {}
        return fields.assign_coords(added).assign(deviations).assign_attrs(about)

    def __str__(self) -> str:
        half = self.ratio_bands.half[-1]
        said = (
            f"A/A0 {self.area_ratio:.3f} +- {half[0]:.3f}, w/w0 {self.width_ratio:.3f} +- {half[1]:.3f} "
            f"(95 % bands, {self.layers} layers)"
        )
        if self.out_of_distribution:
            said += (
                f"\nunusual: {self.unusual}\n"
                "The surrogate was not trained on such a tissue. Do not trust these bands; simulate instead."
            )
        return said

    def _band(self, column: int) -> tuple[float, float]:
        middle, half = float(self.ratios[column]), float(self.ratio_bands.half[-1, column])
        return middle - half, middle + half
