"""Fits as files and tables."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from raptor.core.files import plain, write_json
from raptor.fitting.targets import PARAMETERS, RATIOS, Target

AGAIN = (*RATIOS, "rss", "area_ratio_std", "width_ratio_std", "rss_std")


def write_fit(path: Path, content: Mapping[str, Any]) -> None:
    """Write a fit as JSON; numbers that are not finite become null."""
    write_json(path, plain(content))


def tabulate(fits: Sequence[dict[str, Any]], simulators: Sequence[dict[str, Any]] = ()) -> pd.DataFrame:
    """One row per tissue: target; each kind of fit, its verification and seconds; the paper's fit."""
    by_simulator = {content["tissue"]: content for content in simulators}
    return pd.DataFrame([_row(content, by_simulator.get(content["tissue"])) for content in fits])


def tabulate_joint(joint: Mapping[str, Any], fits: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Common parameters beside mean and spread of the separate fits, ours and the paper's."""
    separate = [fit for fit in fits if fit["tissue"] in joint["targets"]]
    rows = [
        {"fit": "joint", **joint["surrogate"]["parameters"], "rss": joint["surrogate"]["rss"]},
        *_mean_and_spread("separate", [fit["surrogate"]["parameters"] for fit in separate]),
        *_mean_and_spread("paper", [fit["paper"] for fit in separate]),
    ]
    if joint.get("simulator"):
        simulator = joint["simulator"]
        rows.insert(1, {"fit": "joint, simulator", **simulator["parameters"], "rss": simulator["rss"]})
    return pd.DataFrame(rows)


def _row(content: Mapping[str, Any], simulator: Mapping[str, Any] | None) -> dict[str, Any]:
    """One tissue's row."""
    target, paper = Target(**content["target"]), content["paper"]
    row: dict[str, Any] = {"tissue": content["tissue"]}
    row |= {f"target_{key}": value for key, value in content["target"].items()}
    row |= _columns("surrogate", content["surrogate"], content["simulation"], content)
    row |= _columns("corrected", content["corrected"], content["corrected_simulation"], content)
    if simulator is not None:
        row |= _columns("simulator", simulator["fit"], simulator["simulation"], simulator)
    if set(RATIOS) <= paper.keys():
        row["paper_simulation_rss"] = target.rss(np.array([paper[name] for name in RATIOS]))
    if "published_simulation" in content:
        row |= {f"paper_again_{key}": content["published_simulation"][key] for key in (*RATIOS, "rss")}
    return row | {f"paper_{key}": value for key, value in paper.items()}


def _columns(
    name: str, fit: Mapping[str, Any], again: Mapping[str, Any], content: Mapping[str, Any]
) -> dict[str, Any]:
    """Columns of a fit and its verification, and the time it took."""
    row = {f"{name}_{key}": value for key, value in fit["parameters"].items()}
    row |= {f"{name}_{key}": fit[key] for key in (*RATIOS, "rss")}
    row |= {f"{name}_again_{key}": again[key] for key in AGAIN}
    row |= {f"{name}_determined": fit["rank"], f"{name}_evaluations": fit["evaluations"]}
    return row | {f"{name}_seconds": content[f"{name}_seconds"]}


def _mean_and_spread(name: str, fits: Sequence[Mapping[str, float]]) -> list[dict[str, Any]]:
    """Mean and standard deviation over separate fits of each parameter."""
    values = pd.DataFrame(fits).reindex(columns=list(PARAMETERS)).dropna()
    if len(values) < 2:
        return []
    moments = {"mean": values.mean(), "standard deviation": values.std()}
    return [
        {"fit": f"{name}, {what}"} | dict(zip(PARAMETERS, found.tolist(), strict=True))
        for what, found in moments.items()
    ]
