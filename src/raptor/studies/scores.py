"""Scores of predictions as distributions: of samples, of the chance that posts are held, and of the flag."""

import numpy as np
import pandas as pd
from scipy.stats import mannwhitneyu

from raptor.dataset.stack import Sample
from raptor.fields.resample import block_average
from raptor.fields.tethers import seen_held
from raptor.surrogate.prediction import Prediction

CHANCES = (0.0, 0.1, 0.5, 0.9)
"""Lower ends of the classes of predicted chances that a tether is held."""


def scores(guess: Prediction, sample: Sample) -> dict[str, float]:
    """Scores of the answers behind a prediction as samples of density, and of the chance that posts are held.

    `crps_density`: the fair continuous ranked probability score, mean over pixels, on the networks' raster;
    `spread` and `skill`: variance of the answers, corrected for their number, and squared error of their
    mean; `brier`: sum over tethers of the squared error of the chance, `seen_held` and `seen`: how many
    of them the simulated tissue encloses, and of how many; `seen_at_10` and so on: the same for those with a
    predicted chance in each class of `CHANCES`, and `chance_at_10`, the sum of these chances.
    """
    import torch  # here, because tables and figures do not wait for it
    from torch_crps import crps_ensemble

    answers = guess.answers[:, 0].astype(np.float64)
    wanted = block_average(sample.fields[0].astype(np.float64), answers.shape[-1])
    last = torch.from_numpy(np.moveaxis(answers, 0, -1))
    crps = crps_ensemble(last, torch.from_numpy(wanted), biased=False)
    truth = seen_held(sample.fields[0], guess.cast)
    known = np.isfinite(truth) & np.isfinite(guess.held)
    truth, chance = truth[known], guess.held[known]
    classes = np.digitize(chance, CHANCES) - 1
    found = {}
    for number, lowest in enumerate(CHANCES):
        there = classes == number
        found[f"seen_at_{100 * lowest:.0f}"] = float(there.sum())
        found[f"seen_held_at_{100 * lowest:.0f}"] = float(truth[there].sum())
        found[f"chance_at_{100 * lowest:.0f}"] = float(chance[there].sum())
    return {
        "crps_density": float(crps.mean()),
        "spread": float(answers.var(axis=0, ddof=1).mean() * (1 + 1 / len(answers))),
        "skill": float(((answers.mean(axis=0) - wanted) ** 2).mean()),
        "brier": float(((chance - truth) ** 2).sum()),
        "seen_held": float(truth.sum()),
        "seen": float(known.sum()),
        **found,
    }


def summary_of(metrics: pd.DataFrame) -> dict[str, float]:
    """Scores of a set of predictions with bands.

    `crps_density`; `spread_over_skill`, 1 if answers scatter as simulations do; `brier`, the Brier score of
    the chance that a tether is held, and `brier_of_base_rate`, that of the share of tethers that are;
    `flag_auc`, how well the flag's measure tells the quarter with the largest errors from the rest: it is the
    disagreement, or the distance where that is out of distribution.
    """
    total = metrics[["spread", "skill", "brier", "seen_held", "seen"]].sum()
    rate = total["seen_held"] / total["seen"] if total["seen"] else np.nan
    disagreement, distance = metrics["disagreement"], metrics["distance"]
    doubt = distance.where(distance > 1, disagreement).clip(lower=disagreement)
    large = metrics["vrmse_density"] >= metrics["vrmse_density"].quantile(0.75)
    return {
        "crps_density": float(metrics["crps_density"].mean()),
        "spread_over_skill": float(np.sqrt(total["spread"] / total["skill"])),
        "brier": float(total["brier"] / total["seen"]) if total["seen"] else float("nan"),
        "brier_of_base_rate": float(rate * (1 - rate)),
        "flag_auc": float(_auc(doubt[large], doubt[~large])),
    }


def _auc(high: pd.Series, low: pd.Series) -> float:
    """Chance that a random member of one set exceeds one of the other: the area under the ROC curve."""
    if not (len(high) and len(low)):
        return float("nan")
    return float(mannwhitneyu(high, low).statistic) / (len(high) * len(low))
