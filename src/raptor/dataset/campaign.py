"""Campaigns: which moulds are simulated at which parameters, how often, and which runs are held out.

Every random choice about a run derives from (root seed, name of the campaign, number of the draw), so it does
not depend on batches, threads, retries or other campaigns.
"""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import SeedSequence
from pydantic import Field, model_validator

from raptor.core.blocks import Block, Name, Positive
from raptor.core.errors import RaptorError
from raptor.dataset.design import Run
from raptor.moulds.families import MouldFamilies
from raptor.moulds.geometry import Mould
from raptor.moulds.out_of_distribution import long_bars, slender_strips
from raptor.moulds.random_moulds import RandomMoulds
from raptor.moulds.reading import SUFFIXES, find_mould, read_at_scale
from raptor.parameters import DELTA, KAPPA_NNN, KAPPA_NNNN, Bounds, CellParameters, largest_kappa_nnnn

DRAWN: dict[str, Callable[[Any, np.random.Generator, int, str], Mould]] = {
    "random": RandomMoulds.draw,
    "families": MouldFamilies.draw,
    "long_bars": long_bars,
    "slender_strips": slender_strips,
}
"""Kinds of random moulds, by their name in a configuration."""
CANDIDATES = 8  # draws from which a model selects one
ATTEMPTS = 10_000

Base = tuple[Sequence[Run], Mapping[str, Mould]]
"""Runs and moulds of a campaign that another one repeats."""
Score = Callable[[Mould, CellParameters], float]
"""Expected value of a run for training a model."""


class Grid(Block):
    """Points of a sweep: every combination of values."""

    delta: tuple[float, ...] = Field(min_length=1, description="values of delta")
    kappa_nnn: tuple[float, ...] = Field(min_length=1, description="values of kappa_nnn, in kappa0")
    ratio: tuple[float, ...] = Field(
        min_length=1, description="values of kappa_nnnn/kappa_nnn, at most 1/sqrt(2)"
    )

    @model_validator(mode="after")
    def _consistent(self) -> "Grid":
        for name in type(self).model_fields:
            values = getattr(self, name)
            if list(values) != sorted(set(values)):
                raise ValueError(f"{name} is {list(values)}; ascending values are needed")
        for parameters in self.points:
            parameters.require_sampled("grid")
        return self

    @property
    def points(self) -> list[CellParameters]:
        """Parameters of each point, the ratio changing fastest."""
        return [
            CellParameters(delta, kappa, round(kappa * ratio, 12))
            for delta, kappa, ratio in product(self.delta, self.kappa_nnn, self.ratio)
        ]


class Campaign(Block):
    """A set of simulations: moulds, parameters, seeds and splits."""

    moulds: str | tuple[str, ...] = Field(
        "random",
        min_length=1,
        description="random, families: drawn by random_moulds or mould_families; long_bars, slender_strips: "
        "drawn unlike the random ones; or library moulds, mould files or folders of them, one or a list, "
        "found beside the configuration, in the working directory or in the library",
    )
    repeat_of: Name | None = Field(
        None, description="campaign whose test runs are simulated again with other seeds: the noise floor"
    )
    selected_by: Name | None = Field(
        None, description=f"model that selects the runs, from {CANDIDATES} times as many, by disagreement"
    )
    runs: Positive = Field(
        24, description="moulds drawn, parameters drawn for moulds given, or test runs repeated"
    )
    test: int | None = Field(None, ge=0, description="runs held out for evaluation; null: all")
    validation: int = Field(0, ge=0, description="runs for choosing the best weights and for calibration")
    edge: int = Field(0, ge=0, description="runs with delta at one of the two ends of its range")
    seeds: Positive = Field(1, description="simulations of each run or point of a grid")
    delta: tuple[float, float] = Field(
        (DELTA.lower, DELTA.upper), description="range of the cell-matrix interaction, half open"
    )
    kappa_nnn: tuple[float, float] = Field(
        (KAPPA_NNN.lower, KAPPA_NNN.upper),
        description="range of the second spring constant, in kappa0",
    )
    kappa_nnnn: tuple[float, float] = Field(
        (KAPPA_NNNN.lower, KAPPA_NNNN.upper),
        description="range of the third spring constant, in kappa0; never above kappa_nnn/sqrt(2)",
    )
    grid: Grid | None = Field(
        None,
        description="delta, kappa_nnn and ratio (kappa_nnnn/kappa_nnn): each mould is simulated at every "
        "combination of these values, instead of the ranges",
    )

    @property
    def kind(self) -> str | None:
        """A key of `DRAWN`, or None for given moulds and for those of another campaign."""
        named = isinstance(self.moulds, str) and self.moulds in DRAWN and self.repeat_of is None
        return str(self.moulds) if named else None

    @property
    def tests(self) -> int:
        """Number of runs held out."""
        return self.runs if self.test is None else self.test

    @model_validator(mode="after")
    def _consistent(self) -> "Campaign":
        if self.tests + self.validation > self.runs:
            raise ValueError(
                f"test ({self.tests}) and validation ({self.validation}) are more than the {self.runs} runs; "
                "lower them or raise runs"
            )
        if self.edge > self.runs:
            raise ValueError(f"edge ({self.edge}) is more than runs ({self.runs})")
        for name, paper in (("delta", DELTA), ("kappa_nnn", KAPPA_NNN), ("kappa_nnnn", KAPPA_NNNN)):
            low, high = getattr(self, name)
            if not paper.lower <= low < high <= paper.upper:
                raise ValueError(
                    f"{name} is [{low}, {high}]; an ascending range within "
                    f"[{paper.lower}, {paper.upper}] is needed"
                )
        if self.kappa_nnnn[0] > largest_kappa_nnnn(self.kappa_nnn[1]):
            raise ValueError(
                f"kappa_nnnn starts at {self.kappa_nnnn[0]}, above kappa_nnn/sqrt(2) for every "
                f"kappa_nnn up to {self.kappa_nnn[1]}; lower kappa_nnnn or raise kappa_nnn"
            )
        if self.selected_by and self.edge:
            raise ValueError("edge is for runs drawn at random, not for those that a model selects")
        if self.kind is None and (self.test is not None or self.validation or self.selected_by):
            raise ValueError(
                "test, validation and selected_by are for random moulds; runs on given moulds, and "
                "repeated runs, are all held out"
            )
        return self

    def files(self) -> dict[str, Path]:
        """Files of the given moulds, by name.

        Raises
        ------
        RaptorError
            If a name is neither a mould's nor a file's, a folder holds none, or two have one name.
        """
        if self.kind or self.repeat_of:
            return {}
        names = [self.moulds] if isinstance(self.moulds, str) else self.moulds
        paths = [path for name in names for path in _mould_files(name)]
        found = {path.stem: path for path in paths}
        if len(found) < len(paths):
            raise RaptorError(f"moulds: two of {', '.join(map(str, paths))} have the same name; rename one")
        return found

    def simulations(self, repeated: int = 0) -> int:
        """Number of simulations; `repeated` is that of the test simulations of the campaign it repeats.

        Raises
        ------
        RaptorError
            As `files`.
        """
        if self.repeat_of is not None:
            return min(self.runs, repeated) * self.seeds
        given, points = len(self.files()), 1 if self.grid is None else len(self.grid.points)
        return (given if given and self.grid else self.runs) * points * self.seeds

    def test_simulations(self, repeated: int = 0) -> int:
        """Number of simulations held out; raises as `files` does."""
        whole = self.simulations(repeated)
        return whole if self.kind is None else whole // self.runs * self.tests

    def draw_parameters(self, rng: np.random.Generator, *, edge: bool = False) -> CellParameters:
        """Delta uniform, or at an end of its range; both kappas uniform over the bounded region (paper).

        Raises
        ------
        RaptorError
            If the ranges allow no kappa_nnnn <= kappa_nnn/sqrt(2).
        """
        delta, kappa_nnn, kappa_nnnn = (Bounds(*r) for r in (self.delta, self.kappa_nnn, self.kappa_nnnn))
        drawn = rng.uniform(delta.lower, delta.upper)
        if edge:
            drawn = delta.lower if rng.random() < 0.5 else delta.upper
        for _ in range(ATTEMPTS):
            second = rng.uniform(kappa_nnn.lower, kappa_nnn.upper)
            third = rng.uniform(kappa_nnnn.lower, kappa_nnnn.upper)
            if third <= largest_kappa_nnnn(second):
                return CellParameters(float(drawn), float(second), float(third))
        raise RaptorError(
            "no kappa_nnnn <= kappa_nnn/sqrt(2) lies within the configured ranges; lower kappa_nnnn"
        )


def _mould_files(name: str) -> list[Path]:
    """The file of a mould, or the mould files of a folder."""
    if not Path(name).is_dir():
        return [find_mould(name)]
    paths = sorted(path for path in Path(name).iterdir() if path.suffix.lower() in SUFFIXES)
    if not paths:
        raise RaptorError(f"moulds: the folder {name} holds no mould file ({', '.join(SUFFIXES)})")
    return paths


@dataclass(frozen=True)
class _Draw:
    """A mould, the parameters at which it is simulated, and the seeds, one per simulation."""

    number: int
    mould: Mould
    points: Sequence[CellParameters]
    seeds: Sequence[int]


class Design(Block):
    """All that the design of a campaign depends on; None if irrelevant to its kind of moulds."""

    name: Name
    seed: int
    layers: int | None
    mould_scale: float | None
    drawn_from: RandomMoulds | MouldFamilies | None
    campaign: Campaign

    def make(
        self,
        base: Base | None = None,
        score: Score | None = None,
        on_progress: Callable[[int], None] = lambda candidate: None,
    ) -> tuple[list[Run], list[Mould]]:
        """The runs of the campaign, and its moulds.

        Parameters
        ----------
        base
            Runs and moulds of the campaign that it repeats.
        score
            Of the model that selects its runs.
        on_progress
            Called for each candidate scored.

        Raises
        ------
        RaptorError
            If the bounds allow no mould or no parameters.
        """
        campaign = self.campaign
        if campaign.repeat_of is not None:
            if base is None:
                raise RaptorError(f"{self.name} repeats {campaign.repeat_of}; its runs are needed")
            runs, moulds = self._repeat(*base)
        else:
            draws: list[_Draw]
            notes: dict[int, dict[str, str]] = {}
            if campaign.selected_by is None:
                draws = self._draws(campaign.runs)
            else:
                draws, notes = self._select(score, on_progress)
            splits, edges = self._splits(), self._edges()
            runs = []
            for place, draw in enumerate(draws):
                own = notes.get(draw.number, {}) | ({"edge": str(edges[place])} if campaign.edge else {})
                own |= {"family": draw.mould.family} if draw.mould.family else {}
                rows = zip((p for p in draw.points for _ in range(campaign.seeds)), draw.seeds, strict=True)
                runs += [Run(0, draw.mould.name, splits[place], p, seed, own) for p, seed in rows]
            moulds = list({draw.mould.name: draw.mould for draw in draws}.values())
        if len({run.seed for run in runs}) < len(runs):
            raise RaptorError(f"two simulations of {self.name} drew one seed; change the root seed")
        return [replace(run, simulation=number) for number, run in enumerate(runs)], moulds

    def _stream(self, *numbers: int) -> SeedSequence:
        """A random stream of the campaign's own."""
        own = int.from_bytes(hashlib.sha256(self.name.encode()).digest()[:8])
        return SeedSequence([self.seed, own, *numbers])

    def _draws(self, count: int) -> list[_Draw]:
        """A number of random moulds, or all given ones, with parameters and seeds."""
        campaign = self.campaign
        given = [self._read(name, path) for name, path in campaign.files().items()]
        count = len(given) if given and campaign.grid else count
        edges = self._edges()
        draws = []
        for number in range(count):
            shape, values, seeds = self._stream(0, number).spawn(3)
            mould = given[number % len(given)] if given else self._draw_mould(shape, number)
            edge = number < len(edges) and bool(edges[number])
            drawn = [campaign.draw_parameters(np.random.default_rng(values), edge=edge)]
            points = campaign.grid.points if campaign.grid else drawn
            draws.append(_Draw(number, mould, points, _seeds(seeds, len(points) * campaign.seeds)))
        return draws

    def _read(self, name: str, path: Path) -> Mould:
        """A given mould, named after its file; library moulds at the configured scale."""
        return replace(read_at_scale(path, self.mould_scale or 1.0), name=name)

    def _draw_mould(self, stream: SeedSequence, number: int) -> Mould:
        name, draw = f"{self.name}_{number:05d}", DRAWN[str(self.campaign.kind)]
        assert self.drawn_from is not None and self.layers is not None
        return draw(self.drawn_from, np.random.default_rng(stream), self.layers, name)

    def _select(
        self, score: Score | None, on_progress: Callable[[int], None]
    ) -> tuple[list[_Draw], dict[int, dict[str, str]]]:
        """The highest-scoring of many draws, with their scores, by number of the draw."""
        if score is None:
            raise RaptorError(f"{self.name} is selected by {self.campaign.selected_by}; its score is needed")
        draws, scores = self._draws(CANDIDATES * self.campaign.runs), []
        for draw in draws:
            scores.append(float(np.mean([score(draw.mould, p) for p in draw.points])))
            on_progress(draw.number)
        chosen = np.sort(np.argsort(scores, kind="stable")[::-1][: self.campaign.runs])
        return [draws[n] for n in chosen], {int(n): {"disagreement": repr(scores[n])} for n in chosen}

    def _repeat(self, runs: Sequence[Run], moulds: Mapping[str, Mould]) -> tuple[list[Run], list[Mould]]:
        """Randomly chosen test runs, each repeated with other seeds."""
        test = [run for run in runs if run.split == "test"]
        order = np.random.default_rng(self._stream(1)).permutation(len(test))[: self.campaign.runs]
        chosen = [test[place] for place in sorted(order)]
        again = [
            replace(run, seed=seed, own={"repeat_of": str(run.simulation)})
            for run in chosen
            for seed in _seeds(self._stream(0, run.simulation), self.campaign.seeds)
        ]
        return again, list({run.mould: moulds[run.mould] for run in chosen}.values())

    def _splits(self) -> list[str]:
        """The split of each run; all runs of one draw have the same split."""
        campaign = self.campaign
        names = np.full(max(campaign.runs, len(campaign.files())), "train", dtype=object)
        if campaign.kind is None:
            names[:] = "test"
        order = np.random.default_rng(self._stream(1)).permutation(campaign.runs)
        names[order[: campaign.tests]] = "test"
        names[order[campaign.tests : campaign.tests + campaign.validation]] = "validation"
        return [str(name) for name in names]

    def _edges(self) -> list[bool]:
        """Whether each run has delta at an end of its range."""
        order = np.random.default_rng(self._stream(2)).permutation(self.campaign.runs)
        chosen = set(order[: self.campaign.edge].tolist())
        return [number in chosen for number in range(self.campaign.runs)]


def _seeds(stream: SeedSequence, count: int) -> list[int]:
    """Seeds of simulations, of 53 bits, which every tool reads exactly."""
    return [int(state >> np.uint64(11)) for state in stream.generate_state(count, np.uint64)]
