"""The designer: one HTML file on which one draws a mould and sees the tissue that a surrogate predicts.

The page itself is built from `designer/` and comes with the package; this module embeds in it the networks of
a surrogate, as ONNX, and what the page has to know of the package, so that nothing is said twice.
"""

import base64
import gzip
import json
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from raptor.core.errors import RaptorError
from raptor.core.files import write_text
from raptor.core.version import __version__
from raptor.fields import shape, tethers
from raptor.frame import IMAGE_SIZE
from raptor.moulds import cast, geometry
from raptor.moulds.geometry import CLEARANCE
from raptor.moulds.library import MOULDS
from raptor.moulds.library.tissues import load_tissues
from raptor.moulds.reading import read_mould
from raptor.parameters import BOUNDS
from raptor.plotting.drawing import DIVERGING, SEQUENTIAL
from raptor.raster import DEEP, REACH, SIGMA, density_threshold
from raptor.symmetry import FIELDS

if TYPE_CHECKING:
    from raptor.surrogate.inference import Surrogate

PAGE, ENGINE = "page.html", "engine.wasm.gz"
"""The page without data, and onnxruntime's WebAssembly."""
PLACES = ("<!-- model -->", "<!-- networks -->")
"""Where the page takes what it knows, and the networks: last, so that it is seen while they load."""
LARGEST = 20 * 10**6  # bytes
CONSTANTS = {
    "IMAGE_SIZE": IMAGE_SIZE, "SIGMA": SIGMA, "DEEP": DEEP, "REACH": REACH,
    "STRICTLY": geometry.STRICTLY, "SMALLEST_TETHER": geometry.SMALLEST_TETHER,
    "TOUCHING": geometry.TOUCHING, "FITTED": geometry.FITTED, "CLEARANCE": geometry.CLEARANCE,
    "THIN": cast.THIN, "GAP": shape.GAP, "ENCLOSING": shape.ENCLOSING,
    "SAMPLES_PER_PIXEL": shape.SAMPLES_PER_PIXEL, "CLOSED": tethers.CLOSED, "OPEN": tethers.OPEN,
}  # fmt: skip
"""Constants of the package that the page works by."""


def write_designer(path: Path, model: Path | None = None) -> int:
    """Write the page with the networks of a surrogate; returns its size in bytes.

    Parameters
    ----------
    model : Path or None
        Folder of the surrogate; None for the shipped one.

    Raises
    ------
    RaptorError
        If the surrogate cannot be read or is not calibrated, its networks cannot be written as ONNX, or the
        page would be larger than 20 MB.
    """
    from raptor.surrogate.files import load, read_description
    from raptor.surrogate.onnx_export import export_networks
    from raptor.surrogate.rules import SHIPPED

    model = SHIPPED if model is None else model
    surrogate = load(model)
    about = _about(surrogate) | {"identity": read_description(model)["identity"]}
    networks = export_networks(surrogate)
    folder = files("raptor.report.designer")
    parts = {"engine": (folder / ENGINE).read_bytes(), "graph": _packed(networks.graph)}
    parts |= {"refine": _packed(networks.refine)} if networks.refine else {}
    parts |= {
        f"weights-{number}": _packed(_bytes_apart(weights)) for number, weights in enumerate(networks.weights)
    }
    text = json.dumps(about, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    packed = [
        f'<script type="application/gzip" id="{name}">{base64.b64encode(content).decode("ascii")}</script>'
        for name, content in parts.items()
    ]
    page = (folder / PAGE).read_text(encoding="utf-8")
    data = (f'<script type="application/json" id="model">{text}</script>', "\n".join(packed))
    for place, content in zip(PLACES, data, strict=True):
        page = page.replace(place, content, 1)
    size = len(page.encode())
    if size > LARGEST:
        raise RaptorError(
            f"the page would take {size / 1e6:.1f} MB, and {LARGEST / 1e6:.0f} are allowed; choose a model "
            "of fewer or smaller networks"
        )
    write_text(path, page)
    return size


def _packed(content: bytes) -> bytes:
    """Content compressed, the same bytes whenever it is made."""
    return gzip.compress(content, 9, mtime=0)


def _bytes_apart(halves: bytes) -> bytes:
    """Float16 numbers, all low bytes first, then all high ones, which compress by a seventh more so."""
    return np.frombuffer(halves, np.uint8).reshape(-1, 2).T.tobytes()


def _about(surrogate: "Surrogate") -> dict[str, Any]:
    """What the page has to know besides the networks (designer/src/model.ts)."""
    from raptor.surrogate.constraints import TRACE
    from raptor.surrogate.ensemble import DETAIL
    from raptor.surrogate.out_of_distribution import DESCRIPTORS

    calibration = surrogate.require_calibration()
    points = base64.b64encode(np.asarray(calibration.training.points, "<f4").tobytes()).decode("ascii")
    descriptors = [
        {"name": name, "words": found.words, "unit": found.unit} for name, found in DESCRIPTORS.items()
    ]
    return {
        "version": __version__,
        "layers": surrogate.layers,
        "pixels": surrogate.pixels,
        "network_pixels": surrogate.architecture.pixels,
        "members": len(surrogate.members),
        "noise": [own.tolist() for own in surrogate.noise(8)] if surrogate.architecture.noise else [],
        "physical": surrogate.members[0].physical is not None,
        "clearance": CLEARANCE,
        "threshold": surrogate.threshold,
        "own_threshold": surrogate.own_threshold,
        "cast_threshold": density_threshold(surrogate.layers, surrogate.pixels),
        "fields": FIELDS,
        "scaling": {"offset": surrogate.scaling.offset, "scale": surrogate.scaling.scale},
        "calibration": calibration.as_json() | {"points": points},
        "descriptors": descriptors,
        "bounds": {name: {"lower": box.lower, "upper": box.upper} for name, box in BOUNDS.items()},
        "constants": CONSTANTS | {"TRACE": TRACE, "DETAIL": DETAIL},
        "moulds": [
            {"name": name, "feature": read_mould(name).as_feature()} for name in MOULDS
        ],
        "tissues": [
            {"name": name, "mould": tissue.mould, "cells": _cells(tissue.paper)}
            for name, tissue in load_tissues().items()
        ],
        "colours": {"sequential": _colours(SEQUENTIAL), "diverging": _colours(DIVERGING)},
    }  # fmt: skip


def _cells(paper: dict[str, float]) -> dict[str, float]:
    """The fitted parameters of a tissue, without the ratios of its simulation."""
    return {name: value for name, value in paper.items() if name in BOUNDS}


def _colours(name: str) -> str:
    """A colour map of the figures as hexadecimal digits, six for each of its 256 colours."""
    rows = mpl.colormaps[name](np.arange(256), bytes=True)
    return bytes(np.asarray(rows)[:, :3].ravel()).hex()
