"""Search for moulds as a user asks for it."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.optimisation.designs import Designs
from raptor.optimisation.evaluation import Evaluator
from raptor.optimisation.finalists import best_of, choose, predicted, ranked, simulated
from raptor.optimisation.genes import GENES
from raptor.optimisation.search import Found, search
from raptor.optimisation.spec import DesignSpec, others, read_spec
from raptor.surrogate.command import load_surrogate
from raptor.surrogate.inference import Surrogate


def design(
    spec: DesignSpec | Mapping[str, Any] | str | Path,
    surrogate: Surrogate | str | Path | None = None,
    on_progress: Callable[[str], None] = lambda note: None,
) -> Designs:
    """Search for moulds whose tissues do what is wanted, and simulate the best of them.

    Parameters
    ----------
    spec : DesignSpec, dict, str or Path
        What is wanted (docs/design.md): a file, or its keys.
    surrogate : Surrogate, str, Path or None
        A surrogate or its folder; None for the shipped one.
    on_progress : callable
        Called with a sentence after each generation and each simulation.

    Raises
    ------
    RaptorError
        If the specification or a mould to compare with cannot be used, or no mould meets the constraints.

    Examples
    --------
    >>> found = design({"tissue": "glial_1", "objectives": [{"measure": "alignment"}]})
    """
    spec = read_spec(spec)
    compared = others(spec.compare)
    if not isinstance(surrogate, Surrogate):
        surrogate = load_surrogate(surrogate)
    evaluator = Evaluator(spec, surrogate)
    found = search(evaluator, on_progress)
    moulds, first = choose(found, evaluator)
    beside = best_of(compared, evaluator)
    table = pd.concat([_about(moulds, "searched", evaluator), _about(beside, "compared", evaluator)])
    second = [predicted([surrogate.cast(mould) for mould in beside], evaluator)] if beside else []
    parts = [table.reset_index(drop=True), pd.concat([first, *second], ignore_index=True)]
    everything = [*moulds, *beside]
    if spec.simulations:
        parts.append(simulated(everything, evaluator, on_progress))
    table = ranked(pd.concat(parts, axis=1), spec)
    return Designs(spec, tuple(everything), table, _front(found, spec), pd.DataFrame(found.progress))


def _about(moulds: Sequence[Mould], group: str, evaluator: Evaluator) -> pd.DataFrame:
    """Name, group, size and symmetry of moulds."""
    layers, pixels = evaluator.surrogate.layers, evaluator.surrogate.pixels
    return pd.DataFrame(
        {
            "design": [mould.name for mould in moulds],
            "group": group,
            "n_cells": [CastMould(mould, layers, pixels).n_cells for mould in moulds],
            "n_tethers": [len(mould.tethers) for mould in moulds],
            "symmetry": [mould.symmetry for mould in moulds],
        }
    )


def _front(found: Found, spec: DesignSpec) -> pd.DataFrame:
    """Objectives and genes of the undominated moulds of a search, the best in the first objective first."""
    signs = [each.sign for each in spec.objectives]
    front = pd.DataFrame(found.objectives * signs, columns=[each.label for each in spec.objectives])
    front = pd.concat([front, pd.DataFrame(found.vectors, columns=list(GENES))], axis=1)
    first = spec.objectives[0]
    return front.sort_values(first.label, ascending=first.sign > 0, ignore_index=True, kind="stable")
