"""The search itself: NSGA-II over vectors, then CMA-ES from the front's ends and its middle.

NSGA-II: K. Deb et al. 2002, doi:10.1109/4235.996017, as in pymoo. CMA-ES: N. Hansen, arXiv:1604.00772, as in
pycma.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.optimisation.evaluation import Evaluator, Judgement
from raptor.optimisation.genes import GENES
from raptor.optimisation.spec import DesignSpec

STEP = 0.06  # of a gene: first deviation of the refinement
LITTER = 16  # moulds of a generation of the refinement
SIDE = 0.05  # weight of the other objectives in each refinement
PENALTY = 10.0  # of a violation, in ranges of an objective

Report = Callable[[str], None]


@dataclass
class Found:
    """All vectors of a search that violate nothing, and its progress.

    Parameters
    ----------
    vectors : ndarray (n, GENES)
    objectives : ndarray (n, objectives)
        Smaller is better.
    progress : list of dict
        One entry a generation: evaluations, seconds, designs on the front and the best of each objective.
    """

    vectors: NDArray[np.float64]
    objectives: NDArray[np.float64]
    progress: list[dict[str, float]] = field(default_factory=list)
    evaluations: int = 0

    def add(self, vectors: NDArray[np.float64], judged: Judgement) -> None:
        """Keep those of judged vectors that violate nothing and that no other dominates."""
        self.evaluations += len(vectors)
        good = (judged.violations <= 0).all(axis=1)
        everything = np.concatenate([self.objectives, judged.objectives[good]])
        kept = undominated(everything)
        self.objectives = everything[kept]
        self.vectors = np.concatenate([self.vectors, vectors[good]])[kept]


def search(evaluator: Evaluator, report: Report = lambda note: None) -> Found:
    """The undominated moulds of a search, by vectors; the same specification and seed give the same.

    Raises
    ------
    RaptorError
        If no mould met the constraints.
    """
    spec, started = evaluator.spec, time.perf_counter()
    found = Found(np.empty((0, len(GENES))), np.empty((0, len(spec.objectives))))

    def judge(vectors: NDArray[np.float64]) -> Judgement:
        judged = evaluator.judge(vectors)
        found.add(vectors, judged)
        found.progress.append(_entry(found, spec, time.perf_counter() - started))
        report(_said(found.progress[-1], judged))
        return judged

    refined = int(spec.search.refined * spec.search.evaluations)
    nearest = _evolve(spec, judge, spec.search.evaluations - refined)
    if len(found.vectors) == 0:
        raise RaptorError(f"no mould of {found.evaluations} meets the constraints; {nearest}")
    _refine(spec, found, judge)
    return found


def undominated(objectives: NDArray[np.float64]) -> NDArray[np.intp]:
    """Indices of the points (n, objectives) that none other is at least as good as in all, ascending."""
    from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting

    if len(objectives) == 0:
        return np.zeros(0, dtype=np.intp)
    _, first = np.unique(objectives, axis=0, return_index=True)
    first.sort()
    front = NonDominatedSorting().do(objectives[first], only_non_dominated_front=True)
    return np.sort(first[front])


def _evolve(spec: DesignSpec, judge: Callable[[NDArray[np.float64]], Judgement], evaluations: int) -> str:
    """NSGA-II for a number of evaluations; says which violation was hardest to avoid."""
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.evaluator import Evaluator as Recorder
    from pymoo.core.problem import Problem
    from pymoo.problems.static import StaticProblem

    names = [
        "made by the process",
        "the distance from the training set",
        *(c.label for c in spec.constraints),
    ]
    problem = Problem(n_var=len(GENES), n_obj=len(spec.objectives), n_ieq_constr=len(names), xl=0.0, xu=1.0)
    algorithm = NSGA2(pop_size=spec.search.population)
    generations = max(1, evaluations // spec.search.population)
    algorithm.setup(problem, termination=("n_gen", generations), seed=spec.search.seed, verbose=False)
    hardest = np.zeros(len(names))
    while algorithm.has_next():
        generation = algorithm.ask()
        judged = judge(generation.get("X"))
        hardest = (judged.violations > 0).mean(axis=0)
        answer = StaticProblem(problem, F=judged.objectives, G=judged.violations)
        Recorder().eval(answer, generation)
        algorithm.tell(infills=generation)
    return f"hardest was {names[int(hardest.argmax())]}; allow more, or search longer"


def _refine(spec: DesignSpec, found: Found, judge: Callable[[NDArray[np.float64]], Judgement]) -> None:
    """CMA-ES from the best mould of each objective and from the front's middle, an equal budget each."""
    import cma

    count = len(spec.objectives)
    aims = [*np.eye(count), np.full(count, 1 / count)][: count + (count > 1)]
    each = (spec.search.evaluations - found.evaluations) // len(aims)
    for number, aim in enumerate(aims if each >= LITTER else []):
        aimed = Aim(found.objectives.min(axis=0), np.ptp(found.objectives, axis=0) + 1e-6, aim + SIDE)
        start = found.vectors[int(aimed.off(found.objectives).argmin())]
        options = {"bounds": [0, 1], "popsize": LITTER, "verbose": -9, "seed": spec.search.seed + 1 + number}
        strategy = cma.CMAEvolutionStrategy(start, STEP, options)
        for _ in range(each // LITTER):
            vectors = np.array(strategy.ask())
            strategy.tell(list(vectors), aimed.cost(judge(vectors)).tolist())
            if strategy.stop():
                break


@dataclass(frozen=True)
class Aim:
    """One number of several objectives: a weighted sum of how far each is off the best, in its range."""

    best: NDArray[np.float64]
    reach: NDArray[np.float64]
    weights: NDArray[np.float64]

    def off(self, objectives: NDArray[np.float64]) -> NDArray[np.float64]:
        """The sum (n,) for objectives (n, m)."""
        return np.asarray((objectives - self.best) / self.reach @ self.weights)

    def cost(self, judged: Judgement) -> NDArray[np.float64]:
        """The same with a penalty for violations (n,)."""
        beyond = np.maximum(judged.violations, 0).sum(axis=1)
        return np.asarray(np.minimum(self.off(judged.objectives), 1e6) + PENALTY * beyond)


def _entry(found: Found, spec: DesignSpec, seconds: float) -> dict[str, float]:
    """One row of the progress."""
    row = {"evaluations": found.evaluations, "seconds": seconds, "front": len(found.vectors)}
    best = found.objectives.min(axis=0) if len(found.objectives) else np.full(len(spec.objectives), np.nan)
    return row | {each.label: each.sign * value for each, value in zip(spec.objectives, best, strict=True)}


def _said(row: dict[str, float], judged: Judgement) -> str:
    """A row of the progress in words."""
    best = ", ".join(
        f"{name} {value:.4g}"
        for name, value in row.items()
        if name not in ("evaluations", "seconds", "front")
    )
    share = float((judged.violations <= 0).all(axis=1).mean())
    return (
        f"{row['evaluations']:,} moulds, {row['evaluations'] / row['seconds']:.0f} a second, "
        f"{row['front']} on the front, {share:.0%} within limits; best {best}"
    )
