"""Croissant metadata of a published folder: every file, and the design of each campaign as records."""

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raptor.core.files import write_text
from raptor.core.version import __version__
from raptor.dataset.netcdf import LICENCE_URL, REFERENCES

if TYPE_CHECKING:
    import mlcroissant

FORMATS = {
    ".csv": "text/csv", ".geojson": "application/geo+json", ".md": "text/markdown",
    ".nc": "application/x-netcdf", ".hdf5": "application/x-hdf5", ".json": "application/json",
    ".yaml": "application/yaml",
}  # fmt: skip
NUMBERS = ("delta", "kappa_nnn", "kappa_nnnn")
IDS = ("simulation", "seed")


def format_of(name: str) -> str:
    """The media type of a file."""
    return FORMATS.get(Path(name).suffix, "text/plain")


def write_croissant(folder: Path, name: str, campaigns: Sequence[str], sums: Mapping[str, str]) -> Path:
    """Write and return croissant.json; mlcroissant validates it in building and again in reading it.

    Parameters
    ----------
    sums : mapping
        SHA-256 by path within the folder.
    """
    import mlcroissant as mlc

    files = [
        mlc.FileObject(
            id=file, name=file, content_url=file, encoding_formats=[format_of(file)], sha256=digest,
            content_size=f"{(folder / file).stat().st_size} B",
        )
        for file, digest in sums.items()
    ]  # fmt: skip
    metadata = mlc.Metadata(
        name=f"raptor_{name}",
        description="CONDOR simulations of tissues that contract in tethered moulds: cells, and images of "
        "eight fields; README.md says what each file is.",
        license=[LICENCE_URL],
        version=__version__,
        cite_as=REFERENCES,
        date_published=datetime.now(UTC).replace(tzinfo=None, microsecond=0),
        creators=[mlc.Organization(name="The RAPTOR developers")],
        distribution=files,
        record_sets=[_records(folder, campaign) for campaign in campaigns],
    )
    path = folder / "croissant.json"
    write_text(path, json.dumps(metadata.to_json(), indent=1, default=str) + "\n")
    mlc.Dataset(jsonld=path)
    return path


def _records(folder: Path, campaign: str) -> "mlcroissant.RecordSet":
    """The runs of a campaign, one record each."""
    import mlcroissant as mlc

    file = f"campaigns/{campaign}/design.csv"
    with (folder / file).open(newline="") as table:
        columns = next(csv.reader(table))
    fields = [
        mlc.Field(
            id=f"{campaign}/{column}", name=column, description=column, data_types=[kind],
            source=mlc.Source(file_object=file, extract=mlc.Extract(column=column)),
        )
        for column, kind in _kinds(columns)
    ]  # fmt: skip
    return mlc.RecordSet(id=campaign, name=campaign, description=f"Runs of {campaign}.", fields=fields)


def _kinds(columns: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """The data type of each column."""
    import mlcroissant as mlc

    for column in columns:
        kind = mlc.DataType.FLOAT if column in NUMBERS else mlc.DataType.TEXT
        yield column, mlc.DataType.INTEGER if column in IDS else kind
