"""The library: standard moulds and measured tissues that come with the package, each a file here.

The paper states that the test mould is a rectangle of 1:2 with a tether in each corner, and that the
I-shape holds its tissue by two long bars in place of six tethering points; it states no sizes. Sizes
here are such that seven layers hold about 10,000 cells, the paper's number. Outlines of the tissues'
moulds are drawn in the paper but not given in numbers: each is an approximation by what its text and
the cited experiments say, made before any fit. Lengths in l0.
"""

import json
from pathlib import Path

FOLDER = Path(__file__).parent
MOULDS = {path.stem: path for path in sorted(FOLDER.glob("*.geojson"))}
"""Files of the standard moulds, by name."""
TISSUES = FOLDER / "tissues.yaml"
"""The measured tissues."""


def describe(name: str) -> str:
    """What the file of a standard mould says of it."""
    document = json.loads(MOULDS[name].read_text(encoding="utf-8"))
    return str(document["features"][0]["properties"]["description"])
