"""The surrogate's prediction of one tissue, with its error bands."""

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from raptor.fields.labelled import MEASURES, labelled, named
from raptor.fields.tethers import posts_lost
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.parameters import CellParameters
from raptor.surrogate.bands import LEVELS, MEASURED, NORMAL, Bands

if TYPE_CHECKING:
    import xarray as xr


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
    measures : ndarray (4,)
        A/A0, w/w0, alignment and anisotropy.
    held : ndarray (tethers,)
        Chance that tissue encloses each tether: the share of samples, or of networks, in which it does. NaN
        if the tissue as cast does not enclose it.
    field_bands : Bands
        Half widths (levels, 8, y, x) of the calibrated bands about the fields.
    measure_bands : Bands
        Half widths (levels, 4) of those about the measures.
    answers : ndarray (n, 8, y', x')
        What the mean is taken over, on the networks' raster.
    disagreement : float
        Of the networks about density, over the value that 99 % of the validation samples stay below.
    distance : float
        From the input to the nearest of the training set, likewise.
    threshold : float
        Density per pixel above which there is tissue in these fields.
    most_unusual : str
        The descriptor of the input that is least like the training set's, with its value and their range.
    kept : int
        Number of samples that `to_dataset` adds, at most `len(answers)`.
    """

    cast: CastMould
    parameters: CellParameters
    values: NDArray[np.float32]
    measures: NDArray[np.float64]
    held: NDArray[np.float64]
    field_bands: Bands
    measure_bands: Bands
    answers: NDArray[np.float32]
    disagreement: float
    distance: float
    threshold: float
    most_unusual: str
    kept: int = 0

    @property
    def mould(self) -> Mould:
        """The mould that the tissue is predicted in."""
        return self.cast.mould

    @property
    def layers(self) -> int:
        """Cell layers of the simulations that the surrogate was trained on."""
        return self.cast.layers

    @property
    def ratios(self) -> NDArray[np.float64]:
        """A/A0 and w/w0, (2,)."""
        return self.measures[:2]

    @property
    def area_ratio(self) -> float:
        """A/A0."""
        return float(self.measures[0])

    @property
    def width_ratio(self) -> float:
        """w/w0 of the central section; NaN where it holds no tissue as cast, or in no sample."""
        return float(self.measures[1])

    @property
    def alignment(self) -> float:
        """1 where all cells lie along the mould's long side, -1 across it: see `directors.alignment`."""
        return float(self.measures[2])

    @property
    def anisotropy(self) -> float:
        """How far cells line up locally, whatever the direction, 0 to 1: see `directors.anisotropy`."""
        return float(self.measures[3])

    @property
    def posts_lost(self) -> int:
        """Tethers that the tissue probably does not enclose."""
        return posts_lost(self.held)

    @cached_property
    def samples(self) -> NDArray[np.float32]:
        """Possible tissues (n, 8, y, x), if the networks sample; otherwise each network's mean by image."""
        from raptor.surrogate.ensemble import full_fields  # here, because torch takes a second to load

        return full_fields(self.answers, self.cast)

    @property
    def area_ratio_band(self) -> tuple[float, float]:
        """Ends of the 95 % band of A/A0."""
        return self._band(0)

    @property
    def width_ratio_band(self) -> tuple[float, float]:
        """Ends of the 95 % band of w/w0."""
        return self._band(1)

    @property
    def alignment_band(self) -> tuple[float, float]:
        """Ends of the 95 % band of alignment."""
        return self._band(2)

    @property
    def anisotropy_band(self) -> tuple[float, float]:
        """Ends of the 95 % band of anisotropy."""
        return self._band(3)

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
        return np.asarray(self.field_bands.half[-1] / NORMAL)

    @property
    def numbers(self) -> dict[str, float | int | bool | str | list[float]]:
        """The predicted numbers by name; bands as half widths."""
        half = dict(zip(MEASURED, self.measure_bands.half[-1].tolist(), strict=True))
        return {
            "mould": self.mould.name, **asdict(self.parameters), "layers": self.layers,
            **dict(zip(MEASURED, self.measures.tolist(), strict=True)),
            **{f"{name}_band95": band for name, band in half.items()},
            "posts_lost": self.posts_lost,
            "held": self.held.tolist(),
            "distance": self.distance, "disagreement": self.disagreement,
            "out_of_distribution": self.out_of_distribution,
            "unusual": self.unusual,
        }  # fmt: skip

    def to_dataset(self) -> "xr.Dataset":
        """`fields`, each with its deviation (`density_std`, ...), and the measures' bands (level,).

        With `kept`, possible tissues too: `samples` (sample, field, y, x).
        """
        fields = self.fields
        share = named("share of simulations that a band covers")
        added: dict[str, Any] = {"level": ("level", list(LEVELS), share)}
        for name, half in zip(MEASURED, self.measure_bands.half.T, strict=True):
            added[f"{name}_band"] = ("level", half, named(f"half width of the band about {name}"))
        for name in ("disagreement", "distance"):
            text = f"{name}, over its usual value; above 1 do not trust the prediction"
            added[name] = ((), getattr(self, name), named(text))
        added_fields: dict[str, Any] = {
            f"{name}_std": (("y", "x"), image, named(f"standard deviation of the error of {name}, per pixel"))
            for name, image in zip(fields, self.deviation, strict=True)
        }
        if self.kept:
            added["field"] = ("field", list(fields), named("name of the field"))
            possible = named("possible tissues, per pixel")
            added_fields["samples"] = (("sample", "field", "y", "x"), self.samples[: self.kept], possible)
        about = {"unusual": self.unusual} if self.out_of_distribution else {}
        return fields.assign_coords(added).assign(added_fields).assign_attrs(about)

    def __str__(self) -> str:
        names = ("A/A0", "w/w0", "alignment")
        bands = zip(names, self.measures, self.measure_bands.half[-1], strict=False)
        said = ", ".join(f"{name} {value:.3f} +- {half:.3f}" for name, value, half in bands)
        said += f" (95 % bands, {self.layers} layers)"
        known = self.held[np.isfinite(self.held)]
        if known.size:
            said += f"; {known.size - self.posts_lost} of {known.size} tethers held"
        if 0.05 < known.min(initial=1.0) < 0.95:
            said += f", the least sure by {known.min():.0%}"
        if self.out_of_distribution:
            said += (
                f"\nunusual: {self.unusual}\n"
                "The surrogate was not trained on such a tissue. Do not trust these bands; simulate instead."
            )
        return said

    def _band(self, column: int) -> tuple[float, float]:
        middle, half = float(self.measures[column]), float(self.measure_bands.half[-1, column])
        return middle - half, middle + half
