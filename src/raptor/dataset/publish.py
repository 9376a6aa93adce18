"""A run's data and weights as one folder that is ready for an archive."""

import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from hashlib import file_digest
from pathlib import Path, PurePosixPath

import netCDF4

from raptor.core.errors import RaptorError
from raptor.core.files import read_text, write_text
from raptor.core.version import MODEL_VERSION, __version__
from raptor.dataset.crate import write_crate
from raptor.dataset.croissant import write_croissant
from raptor.dataset.netcdf import LICENCE, LICENCE_URL, REFERENCES, open_file
from raptor.dataset.well import write_well

MANIFEST = "SHA256SUMS"
"""Checksums of all other files, in the form of sha256sum, which any system checks without RAPTOR. BagIt would
move everything below data/, where neither hubs nor Croissant nor `raptor check` look."""
TABLES = ("design.csv", "moulds.geojson", "examples.csv", "card.md", "checked.txt", "fields.nc")
CODE = (
    "Snakefile",
    "LICENSE",
    "README.md",
    "pyproject.toml",
    "environment-lock.txt",
    "workflow",
    "config",
    "src",
)
"""What makes the data again: the workflow, its default configuration and the package."""
README = Path(__file__).with_suffix(".md")


def publish(
    folder: Path, results: Path, campaigns: Sequence[str], model: Mapping[str, Path], code: Path
) -> None:
    """Make the folder anew from a run's results.

    Campaigns with shards, stack, tables and card; the stacks in The Well's layout; a model; the workflow and
    its configuration; README, checksums, Croissant and RO-Crate. Files of the run are hard links, which take
    no room; copies where the disk has no such links or a file does not state its licence yet. Code is copied,
    since an editor may change it in place.

    Parameters
    ----------
    model : mapping
        Files of the model by their names in `surrogate/`; may be empty.
    code : Path
        The project's folder.

    Raises
    ------
    RaptorError
        If a file of a campaign is missing, or a file cannot be written.
    """
    if folder.exists():
        shutil.rmtree(folder)
    for campaign in campaigns:
        source, target = results / "campaigns" / campaign, folder / "campaigns" / campaign
        for name in TABLES:
            place(source / name, target / name)
        with open_file(source / "fields.nc") as stack:
            shards = str(stack.shards).split()
        for name in shards:
            place(source / "shards" / name, target / "shards" / name)
        write_well(source / "fields.nc", folder / "well" / campaign)
    for name, path in model.items():
        place(path, folder / "surrogate" / name)
    if (results / "configuration.yaml").is_file():
        place(results / "configuration.yaml", folder / "configuration.yaml")
    (folder / "code").mkdir(parents=True)
    for name in CODE:
        copy = shutil.copy2 if (code / name).is_file() else _copy_tree
        copy(code / name, folder / "code" / name)
    _describe(folder, results.name, campaigns)


def place(source: Path, target: Path) -> None:
    """Put a file into a published folder, as a hard link if it can be; a copy of netCDF gets the licence."""
    if not source.is_file():
        raise RaptorError(f"{source} does not exist; make it with the workflow")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.suffix == ".nc" and not _is_licensed(source):
            shutil.copy2(source, target)
            with netCDF4.Dataset(target, "a") as file:
                file.license = f"{LICENCE}, {LICENCE_URL}"
            shutil.copystat(source, target)
        else:
            _link(source, target)
    except OSError as error:
        raise RaptorError(f"{target} cannot be written: {error.strerror or error}") from error


def _link(source: Path, target: Path) -> None:
    """A hard link, or a copy on another disk or one without links."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def _copy_tree(source: Path, target: Path) -> None:
    shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__", "*.pyc"))


def _is_licensed(path: Path) -> bool:
    with open_file(path) as file:
        return "license" in file.ncattrs()


def _describe(folder: Path, name: str, campaigns: Sequence[str]) -> None:
    """Write README, Croissant, RO-Crate and the checksums, each with what was there before it."""
    text = README.read_text(encoding="utf-8").format(
        name=name,
        campaigns=", ".join(f"`{campaign}`" for campaign in campaigns),
        version=__version__,
        model_version=MODEL_VERSION,
        licence_url=LICENCE_URL,
        references=REFERENCES,
        first=campaigns[0],
    )
    write_text(folder / "README.md", text)
    sums = checksums(folder)
    about = [write_croissant(folder, name, campaigns, sums), write_crate(folder, name, sums)]
    sums |= {path.name: digest_of(path) for path in about}
    write_text(folder / MANIFEST, "".join(f"{digest}  {file}\n" for file, digest in sorted(sums.items())))


def checksums(folder: Path) -> dict[str, str]:
    """SHA-256 of every file of a folder but the manifest, by its path within the folder."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != MANIFEST)
    return {path.relative_to(folder).as_posix(): digest_of(path) for path in paths}


def digest_of(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as file:
        return file_digest(file, "sha256").hexdigest()


def read_manifest(text: str, where: str) -> dict[str, str]:
    """Checksums by path within the folder, from the text of a manifest.

    Raises
    ------
    RaptorError
        If a line is not a checksum and a path within the folder.
    """
    found: dict[str, str] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        digest, _, name = line.partition("  ")
        path = PurePosixPath(name)
        inside = name and not path.is_absolute() and ".." not in path.parts and "\\" not in name
        if len(digest) != 64 or not set(digest) <= set("0123456789abcdef") or not inside:
            raise RaptorError(f"{where}, line {number} is not a SHA-256 and the path of a file of the folder")
        found[name] = digest
    if not found:
        raise RaptorError(f"{where} names no file; give a folder that the rule publish made")
    return found


def check_manifest(folder: Path) -> Iterator[str]:
    """Every file that the manifest names is there, with its checksum; nothing is there besides."""
    path = folder / MANIFEST
    stated = read_manifest(read_text(path, "manifest", "checksums"), str(path))
    present = {each.relative_to(folder).as_posix() for each in folder.rglob("*") if each.is_file()}
    for name in sorted(present - stated.keys() - {MANIFEST}):
        yield f"{name} is not in {MANIFEST}"
    for name, digest in stated.items():
        if name not in present:
            yield f"{name} is in {MANIFEST} but missing; fetch the folder again"
        elif digest_of(folder / name) != digest:
            yield f"{name} does not have the checksum in {MANIFEST}: it was changed or damaged"
