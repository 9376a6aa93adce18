"""Measurement as a user asks for it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from raptor import imaging
from raptor.core.errors import RaptorError
from raptor.imaging.report import MeasuredPhotograph, MeasurementError
from raptor.moulds.geometry import Mould
from raptor.moulds.reading import as_mould


def measure(
    photograph: str | Path | NDArray[Any],
    mould: Mould | str | Path,
    *,
    look: str = "auto",
    threshold: float | None = None,
    landmarks: Sequence[str] = (),
    aligned: bool = False,
    mirrored: bool = False,
    page: int | None = None,
    channel: str | None = None,
) -> MeasuredPhotograph:
    """Measure A/A0, w/w0 and the outline of a tissue in a photograph or mask of its mould.

    Check the result with `raptor.plot`: nothing else shows a wrong edge.

    Parameters
    ----------
    photograph : str, Path or ndarray
        PNG, TIFF or JPEG file, or grey values (row, column).
    mould : Mould, str or Path
        A mould, or a library name or file for `read_mould`.
    look : str
        "bright", "dark" or "auto": the tissue against the floor.
    threshold : float, optional
        Brightness between floor and tissue, relative to the plate; Otsu's by default.
    landmarks : sequence of str
        Two or more of "column,row=x,y" or "column,row=tether 1", instead of the rim.
    aligned : bool
        Whether the image is the frame, 62.5 l0 wide.
    mirrored : bool
        Whether it was taken from below or in a mirror.
    page : int, optional
        Time point, slice or page of a file with several, from 1.
    channel : str, optional
        red, green, blue, saturation or hue: the channel that separates tissue from floor, instead of
        luminance.

    Raises
    ------
    RaptorError
        If the photograph or the mould cannot be read.
    MeasurementError
        If the mould or the tissue cannot be found in it; `raptor.plot` draws the error.
    """
    appearance, mould = imaging.appearance_named(look), as_mould(mould)
    if isinstance(photograph, (str, Path)):
        picture = imaging.read_picture(Path(photograph), page, channel)
    else:
        picture = imaging.as_picture(photograph, "the photograph")
    registration = None
    try:
        registration = imaging.register(picture, mould, landmarks, aligned, mirrored)
        found = imaging.measure(picture, mould, registration, appearance, threshold)
    except RaptorError as error:
        raise MeasurementError(
            str(error), picture, mould, registration or getattr(error, "registration", None)
        ) from error
    return MeasuredPhotograph(picture, mould, found)
