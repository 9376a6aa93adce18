"""The table of a campaign: one row per run, with its mould, split, parameters and seed."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path, read_text
from raptor.parameters import CellParameters

SPLITS = ("train", "validation", "test")
COLUMNS = ("simulation", "mould", "split", "delta", "kappa_nnn", "kappa_nnnn", "seed")


@dataclass(frozen=True)
class Run:
    """One row of a design: a simulation to be made.

    `own` holds the campaign's own columns.
    """

    simulation: int
    mould: str
    split: str
    parameters: CellParameters
    seed: int
    own: Mapping[str, str] = field(default_factory=dict, hash=False)


def write_design(path: Path, runs: Sequence[Run]) -> None:
    """Write a design as CSV, the campaign's own columns last."""
    own = list(dict.fromkeys(name for run in runs for name in run.own))
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow((*COLUMNS, *own))
        for run in runs:
            p = run.parameters
            numbers = (repr(value) for value in (p.delta, p.kappa_nnn, p.kappa_nnnn))
            notes = (run.own.get(name, "") for name in own)
            writer.writerow((run.simulation, run.mould, run.split, *numbers, run.seed, *notes))


def read_design(path: Path) -> list[Run]:
    """Read a design.

    Raises
    ------
    RaptorError
        If the file is missing, lacks a column, or contains an invalid value.
    """
    path = Path(path)
    if not path.is_file():
        raise RaptorError(f"design {path} does not exist; make it with the workflow")
    rows = csv.reader(read_text(path, "design", "a table").splitlines())
    columns = next(rows, [])
    if tuple(columns[: len(COLUMNS)]) != COLUMNS:
        raise RaptorError(f"design {path} has columns {columns}; {list(COLUMNS)} come first")
    try:
        return [_run(row, columns[len(COLUMNS) :]) for row in rows]
    except ValueError as error:
        raise RaptorError(f"design {path}, line {rows.line_num}: {error}") from error


def _run(row: list[str], own: list[str]) -> Run:
    simulation, mould, split, delta, kappa_nnn, kappa_nnnn, seed, *notes = row
    if split not in SPLITS:
        raise ValueError(f"split is '{split}'; allowed are {', '.join(SPLITS)}")
    parameters = CellParameters(float(delta), float(kappa_nnn), float(kappa_nnnn))
    return Run(int(simulation), mould, split, parameters, int(seed), dict(zip(own, notes, strict=True)))
