"""Measurement of experiments: outline, area and width of a tissue from a picture of it in its mould."""

from collections.abc import Sequence

from raptor.core.errors import RaptorError
from raptor.imaging.pictures import Picture, as_picture, read_picture
from raptor.imaging.registration import Registration, aligned, from_landmarks, parse_landmarks
from raptor.imaging.rim import find_rim
from raptor.imaging.tissue import Appearance, Measurement, appearance_named, measure
from raptor.moulds import Mould

__all__ = [
    "Appearance",
    "Measurement",
    "Picture",
    "Registration",
    "aligned",
    "appearance_named",
    "as_picture",
    "find_rim",
    "from_landmarks",
    "measure",
    "parse_landmarks",
    "read_picture",
    "register",
]


def register(
    picture: Picture,
    mould: Mould,
    landmarks: Sequence[str] = (),
    is_aligned: bool = False,
    mirrored: bool = False,
) -> Registration:
    """Register a picture by its landmarks, as aligned, or else by the rim of the depression.

    Landmarks are in pixels of the file. A mask needs landmarks or alignment.

    Raises
    ------
    RaptorError
        If both are given, if a mask comes with neither, or if the registration fails.
    """
    if landmarks and is_aligned:
        raise RaptorError("give landmarks or --aligned, not both")
    if landmarks:
        pixels, points = parse_landmarks(landmarks, mould)
        reduced = (pixels - (picture.reduction - 1) / 2) / picture.reduction
        return from_landmarks(reduced, points, mirrored)
    if is_aligned:
        return aligned(picture.values.shape)
    if picture.mask:
        raise RaptorError("a mask shows no rim to register by; give --aligned or two --landmark at least")
    return find_rim(picture.values, mould, mirrored)
