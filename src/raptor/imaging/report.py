"""A measurement as a sentence, as JSON and as GeoJSON."""

from math import isfinite
from typing import Any

import shapely

from raptor.imaging.pictures import Picture
from raptor.imaging.tissue import Measurement
from raptor.moulds import Mould


def as_record(measurement: Measurement, picture: Picture, mould: Mould) -> dict[str, Any]:
    """A measurement by name, for scripts; unknown values are None.

    `residual` in l0, `pixels_per_l0` in pixels of the file, `angle` in degrees counter-clockwise,
    `threshold` over the plate's brightness, `contrast` in standard deviations.
    """
    registration = measurement.registration
    values = {
        "area_ratio": measurement.area_ratio,
        "width_ratio": measurement.width_ratio,
        "threshold": measurement.threshold,
        "contrast": measurement.contrast,
        "residual": registration.residual,
        "pixels_per_l0": registration.scale * picture.reduction,
        "angle": registration.angle,
    }
    return {
        "mould": mould.name,
        **{key: value if isfinite(value) else None for key, value in values.items()},
        "tissue": measurement.tissue.value,
        "registration": registration.method,
    }


def as_feature(measurement: Measurement, picture: Picture, mould: Mould) -> dict[str, Any]:
    """The tissue's outline in l0 with the measurement as properties, a GeoJSON feature."""
    return {
        "type": "Feature",
        "geometry": shapely.geometry.mapping(measurement.outline),
        "properties": as_record(measurement, picture, mould),
    }


def as_sentence(measurement: Measurement, picture: Picture) -> str:
    """A measurement in one line."""
    registration = measurement.registration
    width = f"{measurement.width_ratio:.3f}" if isfinite(measurement.width_ratio) else "none"
    contrast = f", contrast {measurement.contrast:.1f}" if isfinite(measurement.contrast) else ""
    residual = f", residual {registration.residual:.2f} l0" if isfinite(registration.residual) else ""
    return (
        f"A/A0 {measurement.area_ratio:.3f}, w/w0 {width}; {measurement.tissue.value} tissue, threshold "
        f"{measurement.threshold:.3g}{contrast}; registered by {registration.method}{residual}, "
        f"{registration.scale * picture.reduction:.1f} pixels per l0, "
        f"rotated by {registration.angle:.1f} degrees"
    )
