"""What `accuracy` means: the solver and its tolerances, by name."""

import re
from dataclasses import dataclass, replace

from raptor.condor.contract import Contraction
from raptor.core.errors import RaptorError


@dataclass(frozen=True)
class Accuracy:
    """A solver and its tolerances.

    Parameters
    ----------
    solver : str
        Name of the solver.
    contraction : Contraction
        How closely the contraction is followed, and its tolerance.
    hops, hop_sweeps : int
        Hops (agitation and minimisation) after the contraction, and the sweeps of each.
    anneal_sweeps : int
        Sweeps of the paper's anneal from the cast lattice, in place of the contraction.
    minimised : bool
        Whether the last state is a minimum; a bare anneal's is not.
    precision : str
        "float64", "float32", or "mixed": contracted in single precision and minimised on in double, to
        the same tolerance.
    name : str
        By which `accuracy_named` knows it.
    """

    solver: str
    contraction: Contraction
    hops: int = 0
    hop_sweeps: int = 0
    anneal_sweeps: int = 0
    minimised: bool = True
    precision: str = "float64"
    name: str = "its own"

    @property
    def contracts_alone(self) -> bool:
        """Whether it neither anneals nor hops: what batches of tissues can do."""
        return not (self.anneal_sweeps or self.hops)


ACCURACIES: dict[str, Accuracy] = {
    # Shortening, sweeps, ftol, ftol of the last step, gradient, evaluations of a step and of the last.
    "draft": Accuracy("contract", Contraction(0.3, 5, 2e-2, 2e-3, 0.5, 75, 10000), precision="float32"),
    "standard": Accuracy("contract", Contraction(0.3, 10, 5e-3, 1.5e-4, 0.3, 250, 10000), precision="mixed"),
    "reference": Accuracy(
        "contract", Contraction(0.05, 200, 1e-2, 1e-2, 1e-3, 30000, 30000), hops=5, hop_sweeps=300
    ),
}
"""What `accuracy: draft | standard | reference` means."""

ALLOWED = "draft, standard, reference, anneal-SWEEPS and anneal-SWEEPS-minimised, each also with -float32"


def annealed(sweeps: int, minimised: bool = False) -> Accuracy:
    """The paper's anneal of so many sweeps, as it stands or with a last minimisation."""
    last = Contraction(1.0, 0, -1.0, -1.0, 1e-3, 1, 30000 if minimised else 1)
    return Accuracy("anneal", last, anneal_sweeps=sweeps, minimised=minimised)


def accuracy_named(name: str) -> Accuracy:
    """The accuracy of a name: a level, or anneal-SWEEPS, each with -float32; see ALLOWED.

    Raises
    ------
    RaptorError
        Where there is no such accuracy.
    """
    base = name.removesuffix("-float32")
    anneal_of = re.fullmatch(r"anneal-([1-9]\d{0,8}|[1-9]e[1-8])(-minimised)?", base)
    if anneal_of:
        accuracy = annealed(int(float(anneal_of[1])), bool(anneal_of[2]))
    elif base in ACCURACIES:
        accuracy = ACCURACIES[base]
    else:
        raise RaptorError(f"accuracy is '{name}'; allowed are {ALLOWED}")
    return replace(accuracy, precision=accuracy.precision if name == base else "float32", name=name)
