"""What becomes of a campaign's tissues: posts lost and contraction, by kind of mould and Delta."""

import numpy as np
import pandas as pd

from raptor.parameters import DELTA

BINS = 6


def outcomes(simulated: pd.DataFrame, design: pd.DataFrame, tethers: pd.Series) -> pd.DataFrame:
    """Share of tissues that lost a tether, and median A/A0, by group of moulds and bin of Delta.

    Groups are the families of a design that has them (a mould without one is a group of its own), else the
    moulds if each is simulated more than once.

    Parameters
    ----------
    simulated, design : DataFrame
        Measures of each simulation (`sweep.tabulate`), and the campaign's design.
    tethers : Series
        Number of tethers by mould. Moulds without any lose none and are left out of the share.
    """
    table = simulated.merge(design[["simulation", *(c for c in ("family",) if c in design)]], on="simulation")
    if "family" in table:
        table["group"] = table["family"].fillna(table["mould"])
    else:
        repeated = table["mould"].value_counts().min() > 1
        table["group"] = table["mould"] if repeated else "all moulds"
    edges = np.linspace(DELTA.lower, DELTA.upper, BINS + 1)
    number = np.clip(np.searchsorted(edges, table["delta"], side="right") - 1, 0, BINS - 1)
    table["delta_from"], table["delta_to"] = edges[number].round(3), edges[number + 1].round(3)
    table["held"] = table["mould"].map(tethers) > 0
    table["lost"] = np.where(table["held"], table["posts_lost"] > 0, np.nan)
    return (
        table.groupby(["group", "delta_from", "delta_to"])
        .agg(
            simulations=("simulation", "size"),
            with_tethers=("held", "sum"),
            losing_posts=("lost", "mean"),
            area_ratio=("area_ratio", "median"),
        )
        .reset_index()
    )
