"""A measured photograph: its numbers, as a sentence, as GeoJSON."""

import json
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import shapely

from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path
from raptor.imaging.pictures import Picture
from raptor.imaging.registration import Registration
from raptor.imaging.tissue import Measurement
from raptor.moulds import Mould


class MeasurementError(RaptorError):
    """The tissue or its mould could not be found in a photograph; with how far the measurement came.

    Parameters
    ----------
    registration : Registration or None
        Where the mould was found, well or badly; None if nowhere.
    """

    def __init__(
        self, sentence: str, picture: Picture, mould: Mould, registration: Registration | None
    ) -> None:
        super().__init__(sentence)
        self.picture, self.mould, self.registration = picture, mould, registration


@dataclass(frozen=True)
class MeasuredPhotograph:
    """A tissue measured in a photograph of its mould: what `measure` returns."""

    picture: Picture
    mould: Mould
    measurement: Measurement

    @property
    def area_ratio(self) -> float:
        """A/A0."""
        return self.measurement.area_ratio

    @property
    def width_ratio(self) -> float:
        """w/w0 of the central section; NaN where it misses the depression."""
        return self.measurement.width_ratio

    @property
    def outline(self) -> shapely.Geometry:
        """The tissue, a Polygon or MultiPolygon, l0."""
        return self.measurement.outline

    @property
    def numbers(self) -> dict[str, Any]:
        """The measurement by name; unknown values are None.

        `residual` in l0, `pixels_per_l0` in pixels of the file, `angle` in degrees counter-clockwise,
        `threshold` over the plate's brightness, `contrast` in standard deviations.
        """
        registration = self.measurement.registration
        values = {
            "area_ratio": self.area_ratio,
            "width_ratio": self.width_ratio,
            "threshold": self.measurement.threshold,
            "contrast": self.measurement.contrast,
            "residual": registration.residual,
            "pixels_per_l0": registration.scale * self.picture.reduction,
            "angle": registration.angle,
        }
        mm = self.mould.mm_per_l0
        real = {} if mm is None else {"mm_per_l0": mm, "area_mm2": self.outline.area * mm**2}
        return {
            "mould": self.mould.name,
            **real,
            **{key: value if isfinite(value) else None for key, value in values.items()},
            "tissue": self.measurement.tissue.value,
            "registration": registration.method,
        }

    def as_feature(self) -> dict[str, Any]:
        """The tissue's outline in l0 with the measurement as properties, a GeoJSON feature."""
        geometry = shapely.geometry.mapping(self.outline)
        return {"type": "Feature", "geometry": geometry, "properties": self.numbers}

    def save(self, path: str | Path) -> None:
        """Write the outline and the measurement as GeoJSON."""
        with atomic_path(Path(path)) as temporary:
            temporary.write_text(json.dumps(self.as_feature()) + "\n", encoding="utf-8")

    def __str__(self) -> str:
        found, registration = self.measurement, self.measurement.registration
        width = f"{found.width_ratio:.3f}" if isfinite(found.width_ratio) else "none"
        contrast = f", contrast {found.contrast:.1f}" if isfinite(found.contrast) else ""
        residual = f", residual {registration.residual:.2f} l0" if isfinite(registration.residual) else ""
        return (
            f"A/A0 {found.area_ratio:.3f}, w/w0 {width}; {found.tissue.value} tissue, threshold "
            f"{found.threshold:.3g}{contrast}; registered by {registration.method}{residual}, "
            f"{registration.scale * self.picture.reduction:.1f} pixels per l0, "
            f"rotated by {registration.angle:.1f} degrees"
        )
