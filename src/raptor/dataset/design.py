"""The design of a data set: which moulds and parameters are simulated, and who is held out.

Every random choice about a simulation comes from (root seed, simulation id) alone, so it does not
hang on batches, threads or retries.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.random import Generator

from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path, read_text
from raptor.moulds.geometry import Mould
from raptor.moulds.random_moulds import RandomMoulds
from raptor.parameters import DELTA, KAPPA_NNN, KAPPA_NNNN, Bounds, CellParameters, largest_kappa_nnnn

SPLITS = ("train", "validation", "test")
COLUMNS = (
    "simulation", "mould", "split", "edge", "delta", "kappa_nnn", "kappa_nnnn", "seed",
)  # fmt: skip


@dataclass(frozen=True)
class Run:
    """One row of the design: a simulation to be made."""

    simulation: int
    mould: str
    split: str
    edge: bool
    parameters: CellParameters
    seed: int


@dataclass(frozen=True)
class DesignRules:
    """What a design is drawn from.

    Parameters
    ----------
    simulations, test, validation : int
        How many in all, and how many of them are held out.
    edge : int
        How many have Delta at one of the two ends of its range.
    delta, kappa_nnn, kappa_nnnn : Bounds
        Ranges, half open, within the paper's.
    """

    simulations: int
    test: int
    validation: int
    edge: int
    delta: Bounds = DELTA
    kappa_nnn: Bounds = KAPPA_NNN
    kappa_nnnn: Bounds = KAPPA_NNNN


def sample_design(rules: DesignRules, moulds: RandomMoulds, seed: int) -> tuple[list[Run], list[Mould]]:
    """Draw every simulation of a data set, each with a mould of its own.

    Raises
    ------
    RaptorError
        Where the bounds allow no mould or no parameters.
    """
    splits = _splits(rules, np.random.default_rng([seed, 1]))
    order = np.random.default_rng([seed, 2]).permutation(rules.simulations)
    edge = np.isin(np.arange(rules.simulations), order[: rules.edge])
    runs, drawn = [], []
    for simulation in range(rules.simulations):
        stream = np.random.SeedSequence([seed, 0, simulation])
        shape, values, run_seed = stream.spawn(3)
        mould = moulds.draw(np.random.default_rng(shape), f"m{simulation:05d}")
        parameters = draw_parameters(rules, np.random.default_rng(values), edge=bool(edge[simulation]))
        number = int(run_seed.generate_state(1, np.uint64)[0] >> np.uint64(11))
        runs.append(
            Run(
                simulation,
                mould.name,
                splits[simulation],
                bool(edge[simulation]),
                parameters,
                number,
            )
        )
        drawn.append(mould)
    if len({run.seed for run in runs}) < len(runs):
        raise RaptorError(f"two simulations drew one seed; change the root seed {seed}")
    return runs, drawn


def _splits(rules: DesignRules, rng: Generator) -> list[str]:
    """A split for each simulation; a mould belongs to one simulation, so splits share none."""
    names = np.full(rules.simulations, "train", dtype=object)
    order = rng.permutation(rules.simulations)
    names[order[: rules.test]] = "test"
    names[order[rules.test : rules.test + rules.validation]] = "validation"
    return [str(name) for name in names]


def draw_parameters(rules: DesignRules, rng: Generator, *, edge: bool = False) -> CellParameters:
    """Delta uniform, or at an end; both kappas uniform over the bounded region (paper).

    Raises
    ------
    RaptorError
        Where the ranges allow no kappa_nnnn <= kappa_nnn/sqrt(2).
    """
    delta = rng.uniform(rules.delta.lower, rules.delta.upper)
    if edge:
        delta = rules.delta.lower if rng.random() < 0.5 else rules.delta.upper
    for _ in range(10_000):
        kappa_nnn = rng.uniform(rules.kappa_nnn.lower, rules.kappa_nnn.upper)
        kappa_nnnn = rng.uniform(rules.kappa_nnnn.lower, rules.kappa_nnnn.upper)
        if kappa_nnnn <= largest_kappa_nnnn(kappa_nnn):
            return CellParameters(float(delta), float(kappa_nnn), float(kappa_nnnn))
    raise RaptorError(
        "no kappa_nnnn <= kappa_nnn/sqrt(2) lies within the configured ranges; lower kappa_nnnn"
    )


def write_design(path: Path, runs: list[Run]) -> None:
    """Write the design as CSV, one row a simulation."""
    with atomic_path(path) as temporary, temporary.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for run in runs:
            values = run.parameters
            writer.writerow(
                [run.simulation, run.mould, run.split, run.edge]
                + [repr(v) for v in (values.delta, values.kappa_nnn, values.kappa_nnnn)]
                + [run.seed]
            )


def read_design(path: Path) -> list[Run]:
    """Read a design.

    Raises
    ------
    RaptorError
        Where the file is missing, has other columns, or a value in it makes no sense.
    """
    path = Path(path)
    if not path.is_file():
        raise RaptorError(f"design {path} does not exist; make it with the workflow")
    reader = csv.DictReader(read_text(path, "design", "a table").splitlines())
    if tuple(reader.fieldnames or ()) != COLUMNS:
        raise RaptorError(f"design {path} has columns {reader.fieldnames}; {list(COLUMNS)} are expected")
    try:
        return [_run(row) for row in reader]
    except (TypeError, ValueError, KeyError) as error:
        raise RaptorError(f"design {path}, line {reader.line_num}: {error}") from error


def _run(row: dict[str, str]) -> Run:
    if row["split"] not in SPLITS:
        raise ValueError(f"split is '{row['split']}'; allowed are {', '.join(SPLITS)}")
    parameters = CellParameters(*(float(row[k]) for k in ("delta", "kappa_nnn", "kappa_nnnn")))
    edge = {"True": True, "False": False}[row["edge"]]
    return Run(int(row["simulation"]), row["mould"], row["split"], edge, parameters, int(row["seed"]))
