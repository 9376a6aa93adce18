"""Whether two data sets are the same data (docs/data.md, rule 6)."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from raptor.core.files import read_json
from raptor.dataset.netcdf import open_file
from raptor.dataset.shards import campaign_folders

TABLES = ("design.csv", "moulds.geojson", "examples.csv")


def differences(first: Path, second: Path) -> list[str]:
    """Differences between two results folders or two campaigns, one sentence each.

    Ordered by simulation id, every variable but wall_time must be bit-equal, and every table
    equal. Histories and times may differ.

    Raises
    ------
    RaptorError
        If a folder holds no campaign, or a file of one is missing.
    """
    if all((Path(folder) / "design.csv").is_file() for folder in (first, second)):
        return _campaign_differences(Path(first), Path(second))
    one, two = campaign_folders(first), campaign_folders(second)
    found = [f"campaign {name} is in only one of the folders" for name in sorted(one.keys() ^ two.keys())]
    for name in one.keys() & two.keys():
        found += [f"{name}: {difference}" for difference in _campaign_differences(one[name], two[name])]
    return sorted(found)


def _campaign_differences(first: Path, second: Path) -> list[str]:
    found = [f"{name} differs" for name in TABLES if _table(first / name) != _table(second / name)]
    one, two = _simulations(first), _simulations(second)
    if one.keys() != two.keys():
        found.append(f"simulations {sorted(one.keys() ^ two.keys())} are in only one of the folders")
    for simulation in sorted(one.keys() & two.keys()):
        names = _different(one[simulation], two[simulation])
        if names:
            found.append(f"simulation {simulation}: {', '.join(names)} differ")
    with open_file(first / "fields.nc") as a, open_file(second / "fields.nc") as b:
        found += [f"fields.nc: {name} differs" for name in _different(a.variables, b.variables)]
    return found


def _different(one: Mapping[str, Any], two: Mapping[str, Any]) -> list[str]:
    """Names of the variables that differ, or that only one has."""
    names = dict.fromkeys([*one, *two])
    return [n for n in names if n not in one or n not in two or not _equal(one[n][...], two[n][...])]


def _simulations(folder: Path) -> dict[int, dict[str, Any]]:
    """Every variable of every simulation of a campaign's folder, but its wall time."""
    with open_file(folder / "fields.nc") as stack:
        shards = str(stack.shards).split()
    found: dict[int, dict[str, Any]] = {}
    for shard in shards:
        with open_file(folder / "shards" / shard) as file:
            counts = {"cell": file["row_size"][:], "tether": file["tethers"][:]}
            ends = {name: np.cumsum(count) for name, count in counts.items()}
            for row in range(len(counts["cell"])):
                parts: dict[str, Any] = {
                    name: slice(ends[name][row] - counts[name][row], ends[name][row]) for name in counts
                }
                found[int(file["simulation"][row])] = {
                    name: np.asarray(variable[parts.get(variable.dimensions[0], row)])
                    for name, variable in file.variables.items()
                    if name != "wall_time"
                }
    return found


def _equal(a: Any, b: Any) -> bool:
    a, b = np.asarray(a), np.asarray(b)
    return bool(a.shape == b.shape and np.array_equal(a, b, equal_nan=a.dtype.kind == "f"))


def _table(path: Path) -> Any:
    if path.suffix in (".json", ".geojson"):
        return read_json(path)
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.reader(file))
