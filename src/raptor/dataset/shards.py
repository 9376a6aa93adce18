"""Shards: simulations as files, CF contiguous ragged arrays of cells."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import netCDF4
import numpy as np
from numpy.typing import NDArray

from raptor.condor.accuracy import accuracy_named
from raptor.condor.lattice import Lattice, connect
from raptor.condor.simulate import Tissue
from raptor.core.errors import RaptorError
from raptor.core.version import MODEL_VERSION
from raptor.dataset.design import Run
from raptor.dataset.netcdf import create, open_file, variable
from raptor.fields.labelled import TETHER_MEASURES
from raptor.fields.tethers import posts_lost
from raptor.parameters import PARAMETERS, CellParameters, NetworkModel

RESULTS = {
    "energy": "energy of the bonds, walls excluded, in kappa0 l0^2",
    "wall_energy": "energy of the walls, in kappa0 l0^2",
    "contact_energy": "energy of the contacts that keep bonds from inverting, in kappa0 l0^2",
    "gradient": "largest residual gradient, contacts included, by position or by orientation over delta "
    "(at least 0.02), in kappa0 l0",
    "converged": "1 if the gradient fell below the solver's tolerance times delta (at least 0.02)",
    "inverted_fraction": "share of bonds whose direction has reversed since casting",
    "gradient_evaluations": "evaluations of energy and gradient",
    "sweeps": "sweeps of annealing",
}
ATTRIBUTES = {"gradient": "residual_gradient"}
"""Attributes of a `Tissue` whose names are not those of `RESULTS`."""

MOVE_AWAY = "move it to another folder, and the workflow makes it again"
CELL_VARIABLES = {
    "x0": "cast position x, in l0", "y0": "cast position y, in l0", "z0": "cast position z, in l0",
    "x": "position x, in l0", "y": "position y, in l0", "z": "position z, in l0",
    "sx": "orientation x", "sy": "orientation y", "sz": "orientation z",
    "tension": "mean tension of the cell's bonds, in kappa0 l0",
}  # fmt: skip


@dataclass(frozen=True)
class Record:
    """One simulation read from a shard; arrays as in `Tissue`."""

    simulation: int
    parameters: CellParameters
    seed: int
    energy: float
    converged: bool
    inverted_fraction: float
    wall_time: float
    sites: NDArray[np.float64]
    positions: NDArray[np.float64]
    orientation: NDArray[np.float64]
    tension: NDArray[np.float64]
    held: NDArray[np.float64]
    contact: NDArray[np.float64]

    @property
    def posts_lost(self) -> int:
        """Tethers held in fewer than half of the layers."""
        return posts_lost(self.held)

    @property
    def state(self) -> NDArray[np.float64]:
        """Positions and orientations as one array (6 * cells,), as for the energy."""
        return np.concatenate([self.positions.T.ravel(), self.orientation.T.ravel()])

    def lattice(self, model: NetworkModel) -> Lattice:
        """The bonds, rebuilt from the cast positions."""
        return connect(self.sites, self.parameters, model)


@dataclass(frozen=True)
class Shard:
    """The simulations of one file, their model, and the reasons of failures, by id."""

    records: list[Record]
    model: NetworkModel
    accuracy: str
    device: str
    configuration: str
    failures: dict[int, str]


def write_shard(
    path: Path,
    runs: list[Run],
    simulations: dict[int, Tissue],
    model: NetworkModel,
    accuracy: str,
    configuration: str,
    failures: dict[int, str] | None = None,
    device: str = "cpu",
) -> None:
    """Write the simulations of runs, by id, as one shard, atomically."""
    failures = failures or {}
    with create(path, "CONDOR simulations of tissues in tethered moulds", configuration) as file:
        made = [run for run in runs if run.simulation in simulations]
        write_model(file, model, accuracy, device)
        write_simulations(file, made, [simulations[run.simulation] for run in made])
        if failures:
            file.createDimension("failure", len(failures))
            ids = np.array(list(failures), dtype=np.int32)
            variable(file, "failed_simulation", ("failure",), ids, "simulation that failed")
            variable(file, "failure_reason", ("failure",), list(failures.values()), "why it failed")


def write_model(file: netCDF4.Dataset, model: NetworkModel, accuracy: str, device: str) -> None:
    """Write as attributes what is needed to recompute the simulations."""
    file.shells = np.array(model.shells, dtype=np.int32)
    file.layers = np.int32(model.layers)
    file.tension = model.tension
    file.accuracy = accuracy
    file.solver = accuracy_named(accuracy).solver
    file.device = device  # on a GPU in single precision


def write_simulations(file: netCDF4.Dataset, runs: Sequence[Run], simulations: Sequence[Tissue]) -> None:
    """Write the simulations of runs and their cells into an empty file or group."""
    file.featureType = "point"
    file.createDimension("simulation", len(runs))
    file.createDimension("cell", sum(s.cells for s in simulations))
    along = ("simulation",)
    ids = np.array([run.simulation for run in runs], dtype=np.int32)
    variable(file, "simulation", along, ids, "simulation id")
    seeds = np.array([run.seed for run in runs], dtype=np.int64)
    variable(file, "seed", along, seeds, "seed of the simulation's random stream")
    sizes = np.array([s.cells for s in simulations], dtype=np.int32)
    variable(file, "row_size", along, sizes, "number of cells").sample_dimension = "cell"
    for name, long_name in PARAMETERS.items():
        values = np.array([getattr(run.parameters, name) for run in runs])
        variable(file, name, along, values, long_name)
    for name, long_name in RESULTS.items():
        values = np.array([getattr(s, ATTRIBUTES.get(name, name)) for s in simulations])
        if values.dtype.kind in "bi":
            values = values.astype(np.int8 if name == "converged" else np.int32)
        variable(file, name, along, values, long_name)
    tethers = np.array([len(s.held) for s in simulations], dtype=np.int32)
    file.createDimension("tether", int(tethers.sum()))
    variable(file, "tethers", along, tethers, "number of tethers").sample_dimension = "tether"
    for name, long_name in TETHER_MEASURES.items():
        values = np.concatenate([np.empty(0), *(getattr(s, name) for s in simulations)])
        variable(file, name, ("tether",), values.astype(np.float32), long_name)
    times = np.array([s.wall_time for s in simulations])
    variable(file, "wall_time", along, times, "wall time of the simulation", "s")
    empty = np.empty((0, len(CELL_VARIABLES)))
    columns = np.concatenate([empty, *(_columns(s) for s in simulations)]).astype(np.float32)
    for (name, text), column in zip(CELL_VARIABLES.items(), columns.T, strict=True):
        variable(file, name, ("cell",), column, text)


def _columns(simulation: Tissue) -> NDArray[np.float64]:
    """The cells' variables (cells, 10), in the order of `CELL_VARIABLES`."""
    return np.column_stack(
        [simulation.sites, simulation.positions, simulation.orientation, simulation.tension]
    )


def campaign_folders(folder: Path) -> dict[str, Path]:
    """Folders of the campaigns of a results folder, by name, or the one campaign of its own folder.

    Raises
    ------
    RaptorError
        If the folder is neither.
    """
    folder = Path(folder)
    if (folder / "design.csv").is_file():
        return {folder.resolve().name: folder}
    found = {path.parent.name: path.parent for path in sorted(folder.glob("campaigns/*/design.csv"))}
    if not found:
        raise RaptorError(
            f"{folder} holds neither design.csv nor campaigns/; give a results folder or a campaign's"
        )
    return found


def shard_paths(folder: Path) -> list[Path]:
    """Shards of a campaign's folder, without those being written, whose names begin with a dot."""
    return sorted((Path(folder) / "shards").glob("[0-9]*.nc"))


def read_failures(path: Path, configuration: str | None = None) -> dict[int, str]:
    """Reasons of failed simulations of a shard, by id; raises as `read_shard` does."""
    with _open_shard(path, configuration) as file:
        return _read_failures(file)


def _read_failures(file: netCDF4.Dataset) -> dict[int, str]:
    if "failure" not in file.dimensions:
        return {}
    reasons = zip(file["failed_simulation"][:], file["failure_reason"][:], strict=True)
    return {int(simulation): str(reason) for simulation, reason in reasons}


@contextmanager
def _open_shard(path: Path, configuration: str | None, group: str | None = None) -> Iterator[netCDF4.Dataset]:
    with open_file(path, group) as file:
        found = (getattr(file, "configuration", None), getattr(file, "model_version", None))
        if configuration is not None and found != (configuration, MODEL_VERSION):
            raise RaptorError(
                f"shard {path} is not of this run: it was made by configuration {found[0]}, model version "
                f"{found[1]}, and not {configuration}, {MODEL_VERSION}; {MOVE_AWAY}"
            )
        yield file


def read_shard(path: Path, configuration: str | None = None, group: str | None = None) -> Shard:
    """Read a shard or the group of a file that is one; with `configuration`, require that configuration.

    Raises
    ------
    RaptorError
        If the file is missing, truncated, incomplete, or of another configuration or model.
    """
    with _open_shard(path, configuration, group) as file:
        try:
            shells = [int(shell) for shell in np.atleast_1d(file.shells)]
            model = NetworkModel(
                int(file.layers),
                (shells[0], shells[1], shells[2]),
                str(file.tension),
            )
            return Shard(
                _read_records(file),
                model,
                str(file.accuracy),
                str(file.device),
                str(file.configuration),
                _read_failures(file),
            )
        except (AttributeError, KeyError, IndexError, RuntimeError) as error:
            raise RaptorError(
                f"shard {path} cannot be read whole ({' '.join(str(error).split())}); {MOVE_AWAY}"
            ) from error


def _read_records(file: netCDF4.Dataset) -> list[Record]:
    cells = np.column_stack([file[name][:] for name in CELL_VARIABLES]).astype(np.float64)
    sizes = file["row_size"][:]
    if sizes.sum() != len(cells):
        raise IndexError(f"row_size counts {sizes.sum()} cells, the file holds {len(cells)}")
    names = ("simulation", "seed", "tethers", *PARAMETERS, *RESULTS, *TETHER_MEASURES, "wall_time")
    values = {name: np.ma.filled(file[name][:], np.nan) for name in names}
    records = []
    ends, last = np.cumsum(sizes), np.cumsum(values["tethers"])
    for row, (end, size) in enumerate(zip(ends, sizes, strict=True)):
        block = cells[end - size : end]
        tethers = slice(last[row] - values["tethers"][row], last[row])
        records.append(
            Record(
                simulation=int(values["simulation"][row]),
                parameters=CellParameters(*(float(values[name][row]) for name in PARAMETERS)),
                seed=int(values["seed"][row]),
                energy=float(values["energy"][row]),
                converged=bool(values["converged"][row]),
                inverted_fraction=float(values["inverted_fraction"][row]),
                wall_time=float(values["wall_time"][row]),
                sites=block[:, 0:3],
                positions=block[:, 3:6],
                orientation=block[:, 6:9],
                tension=block[:, 9],
                **{name: values[name][tethers].astype(np.float64) for name in TETHER_MEASURES},
            )
        )
    return records
