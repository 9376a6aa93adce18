"""Prediction as a user asks for it."""

from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path
from typing import overload

from raptor.core.jobs import in_threads
from raptor.moulds.geometry import Mould
from raptor.moulds.reading import as_mould
from raptor.parameters import CellParameters, require_parameters
from raptor.surrogate.files import load
from raptor.surrogate.inference import Surrogate
from raptor.surrogate.prediction import Prediction
from raptor.surrogate.rules import SHIPPED


def load_surrogate(path: str | Path | None = None) -> Surrogate:
    """Load a trained surrogate, or the shipped one.

    Parameters
    ----------
    path : str, Path or None
        Folder with weights.safetensors and model.json, such as results/paper/surrogate/model; None for the
        shipped surrogate.

    Raises
    ------
    RaptorError
        If a file is missing or truncated, or the weights do not fit the model.
    """
    return _shipped() if path is None else load(Path(path))


@overload
def predict(
    mould: Mould | str | Path, cells: CellParameters, surrogate: Surrogate | str | Path | None = None
) -> Prediction: ...


@overload
def predict(
    mould: Mould | str | Path,
    cells: Sequence[CellParameters],
    surrogate: Surrogate | str | Path | None = None,
) -> list[Prediction]: ...


def predict(
    mould: Mould | str | Path,
    cells: CellParameters | Sequence[CellParameters],
    surrogate: Surrogate | str | Path | None = None,
) -> Prediction | list[Prediction]:
    """Predict the tissue of a mould by a surrogate, with 50, 80 and 95 % bands.

    Parameters
    ----------
    mould : Mould, str or Path
        A mould, or what `read_mould` reads: a name of the library, or a file.
    cells : CellParameters or sequence of CellParameters
        Within the range of the training set. Of several, a list of predictions is returned.
    surrogate : Surrogate, str, Path or None
        A surrogate or its folder; None for the shipped one.

    Raises
    ------
    RaptorError
        If the mould cannot be read or holds no cell, a parameter is out of range, or the surrogate cannot
        be read or is not calibrated.

    Examples
    --------
    >>> prediction = predict("glial_1", CellParameters(0.5, 0.5, 0.3))
    """
    several = cells if isinstance(cells, Sequence) else [cells]
    points = [require_parameters(each).require_sampled("prediction") for each in several]
    if not isinstance(surrogate, Surrogate):
        surrogate = load_surrogate(surrogate)
    cast = surrogate.cast(as_mould(mould))
    if not isinstance(cells, Sequence):
        return surrogate.examine(cast, points[0])
    return list(in_threads(partial(surrogate.examine, cast), points))


@cache
def _shipped() -> Surrogate:
    return load(SHIPPED)
