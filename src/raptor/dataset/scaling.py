"""Scaling of fields to [-1, 1] and back, by constants of the training split alone.

The scaling commutes with D4: sxsx and sysy share constants, and so do sxsz and sysz; fields of either sign
are scaled symmetrically about zero.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.core.files import read_json, write_json
from raptor.parameters import BOUNDS, CellParameters
from raptor.symmetry import FIELDS

SHARED = (("sxsx", "sysy"), ("sxsz", "sysz"))
SIGNED = ("tension", "sxsy", "sxsz", "sysz")
INPUTS = ("depression", "tethers", "as_cast", *BOUNDS)


@dataclass(frozen=True)
class Scaling:
    """Per field, scaled = (value - offset) / scale and value = scaled * scale + offset."""

    offset: tuple[float, ...]
    scale: tuple[float, ...]

    def forward(self, fields: NDArray[np.floating]) -> NDArray[np.float32]:
        """Physical fields (..., 8, y, x) to [-1, 1]."""
        offset, scale = self._constants()
        return np.asarray((fields.astype(np.float32, copy=False) - offset) / scale)

    def inverse(self, scaled: NDArray[np.floating]) -> NDArray[np.float32]:
        """Scaled fields (..., 8, y, x) back to physical units."""
        offset, scale = self._constants()
        return np.asarray(scaled.astype(np.float32, copy=False) * scale + offset)

    def _constants(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        offset, scale = (np.array(values, np.float32)[:, None, None] for values in (self.offset, self.scale))
        return offset, scale

    def as_json(self) -> dict[str, Any]:
        """As stored in `normalisation.json` and model.json."""
        return {"fields": list(FIELDS), **asdict(self)}

    @classmethod
    def from_json(cls, content: dict[str, Any]) -> "Scaling":
        """The inverse of `as_json`."""
        return cls(tuple(content["offset"]), tuple(content["scale"]))


def fit_scaling(low: NDArray[np.floating], high: NDArray[np.floating]) -> Scaling:
    """Scaling from the extremes (8,) of each field over the training split."""
    low, high = low.astype(np.float64), high.astype(np.float64)
    for group in SHARED:
        members = [FIELDS.index(name) for name in group]
        low[members], high[members] = low[members].min(), high[members].max()
    for name in SIGNED:
        member = FIELDS.index(name)
        high[member] = max(abs(low[member]), abs(high[member]))
        low[member] = -high[member]
    scale = np.maximum((high - low) / 2, 1e-12)
    return Scaling(tuple(float(v) for v in (high + low) / 2), tuple(float(v) for v in scale))


def scale_inputs(images: NDArray[np.floating], parameters: CellParameters) -> NDArray[np.float32]:
    """The six input channels (6, y, x), about -1 to 1: three images, then the parameters as constants.

    `images` (3, y, x) are those of `resample.coarse_images`: depression, tethers and density as cast.
    """
    channels = np.empty((len(INPUTS), *images.shape[1:]), dtype=np.float32)
    channels[: len(images)] = 2.0 * images - 1.0
    channels[len(images) :] = scaled_parameters(parameters)[:, None, None]
    return channels


def scaled_parameters(parameters: CellParameters) -> NDArray[np.float64]:
    """Delta, kappa_nnn and kappa_nnnn (3,), -1 to 1 over their ranges."""
    return np.array([(getattr(parameters, name) - each.middle) / each.half for name, each in BOUNDS.items()])


def write_scaling(path: Path, scaling: Scaling, campaigns: Sequence[str], fraction: float = 1.0) -> None:
    """Write the constants of campaigns' training splits, with the formula and its inverse in words."""
    content = scaling.as_json() | {
        "formula": "scaled = (value - offset) / scale",
        "inverse": "value = scaled * scale + offset",
        "from": "the training splits alone",
        "campaigns": list(campaigns),
        "training_fraction": fraction,
    }
    write_json(path, content)


def read_scaling(path: Path) -> Scaling:
    """Read the constants.

    Raises
    ------
    RaptorError
        If the file is missing or incomplete.
    """
    try:
        return Scaling.from_json(read_json(path))
    except (ValueError, KeyError) as error:
        raise RaptorError(f"normalisation {path} cannot be read: {error}") from error
