"""Blocks of the configuration, each with its defaults, bounds and explanation."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from raptor.condor.simulate import accuracy_named
from raptor.core.blocks import Block, Name, Positive, Weight
from raptor.moulds.geometry import SMALLEST_TETHER
from raptor.parameters import DELTA, KAPPA_NNN, KAPPA_NNNN, NetworkModel, largest_kappa_nnnn
from raptor.surrogate.rules import ModelRules

AccuracyName = Literal["draft", "standard", "reference"]


def _accuracy(name: str) -> str:
    accuracy_named(name)
    return name


Method = Annotated[str, AfterValidator(_accuracy)]


class Design(Block):
    """How many simulations, who is held out, and what parameters are drawn from."""

    simulations: Positive = Field(64, description="simulations in all, each with a mould of its own")
    test: Positive = Field(12, description="simulations held out for evaluation")
    validation: Positive = Field(8, description="simulations that choose the best weights")
    edge: int = Field(8, ge=0, description="simulations with delta at one of the two ends of its range")
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

    @model_validator(mode="after")
    def _consistent(self) -> "Design":
        if self.test + self.validation >= self.simulations:
            raise ValueError(
                f"test ({self.test}) and validation ({self.validation}) leave none of the "
                f"{self.simulations} simulations for training; lower them or raise simulations"
            )
        if self.edge > self.simulations:
            raise ValueError(f"edge ({self.edge}) is more than simulations ({self.simulations})")
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
        return self


class Moulds(Block):
    """What random moulds are drawn from; lengths in l0."""

    cells: tuple[Positive, Positive] = Field((500, 3000), description="bounds of the number of cells")
    tethers: tuple[int, int] = Field((2, 16), description="bounds of the number of tethers")
    tether_radius: tuple[float, float] = Field((0.8, 1.5), description="bounds of the tethers' radius")
    arm_width: float = Field(4.0, gt=0, le=20, description="narrowest neck, and gap between tethers")
    margin: float = Field(3.0, ge=2.2, le=20, description="rim of the image that stays free: 3 sigma or more")
    symmetry: dict[Literal["none", "mirror", "half_turn", "mirrors", "square"], Weight] = Field(
        {"none": 0.3, "mirror": 0.25, "half_turn": 0.2, "mirrors": 0.2, "square": 0.05},
        description="weight of each symmetry class",
    )

    @model_validator(mode="after")
    def _consistent(self) -> "Moulds":
        for name, least in (("cells", 1), ("tethers", 0), ("tether_radius", SMALLEST_TETHER)):
            low, high = getattr(self, name)
            if not least <= low <= high:
                raise ValueError(f"{name} is [{low}, {high}]; an ascending range from {least} is needed")
        if sum(self.symmetry.values()) <= 0:
            raise ValueError("symmetry gives every class weight 0; give at least one a positive weight")
        return self


class Model(Block):
    """What the paper leaves open about the network of cells."""

    layers: int = Field(4, ge=1, le=64, description="cell layers between floor and fill height")
    shells: tuple[int, int, int] = Field(
        (1, 2, 3), description="neighbour shells of kappa0, kappa_nnn and kappa_nnnn"
    )
    tension: Literal["hooke", "literal"] = Field(
        "hooke", description="hooke: k (|l| - L'); literal: k L', the paper's formula"
    )

    @model_validator(mode="after")
    def _consistent(self) -> "Model":
        NetworkModel(self.layers, self.shells, self.tension)
        return self


class Simulation(Block):
    """How simulations are run."""

    accuracy: AccuracyName = Field("standard", description="draft, standard or reference")
    shard_size: Positive = Field(4, description="simulations a job and a file; does not change results")


class Fields(Block):
    """How cells become images."""

    pixels: Literal[16, 32, 64, 128, 256, 512] = Field(128, description="side of the square image")


class Dataset(Block):
    """What is written beside the unaugmented stack."""

    materialise: bool = Field(False, description="also write the augmented stack, for other tools")
    checked: float = Field(
        1.0, gt=0, le=1, description="part of the simulations, chosen at random, computed again by the check"
    )


class Surrogate(ModelRules):
    """A model, and what it is trained on."""

    model: Name = Field("film_unet", description="name of the model's folder")
    extra: Literal["enriched", "random"] | None = Field(
        None, description="further set that it is trained on beside the design's training split"
    )


class Further(Block):
    """Simulations beside the design, by which the surrogate is judged."""

    floor: int = Field(
        3, ge=0, description="test simulations, or all, repeated with further seeds: the noise floor"
    )
    seeds: int = Field(2, ge=1, le=16, description="further seeds of each of them")
    bars: int = Field(
        2, ge=0, description="simulations of I-shapes held by long bars, unlike all moulds drawn"
    )
    slender: int = Field(2, ge=0, description="simulations of strips slenderer than moulds drawn")
    corner: int = Field(
        2, ge=0, description="simulations in the soft corner: high delta, low kappa_nnn and kappa_nnnn"
    )
    extra: int = Field(
        0,
        ge=0,
        description="simulations of each set of further training: enriched, where networks disagree most, "
        "and random",
    )
    candidates: int = Field(8, ge=2, description="draws a simulation of the enriched set is chosen from")


class Fit(Block):
    """Which tissues are fitted, and how."""

    tissues_file: str | None = Field(
        None, description="measured tissues and their moulds; null: those that come with the package"
    )
    tissues: tuple[Name, ...] = Field(("glial_1",), description="tissues to fit, by name")
    mould_scale: float = Field(
        0.7, gt=0, le=1.5, description="tissue moulds are drawn at this fraction of their size"
    )
    starts: Literal[16, 32, 64, 128, 256] = Field(
        64, description="points of the Sobol sequence from which fits start"
    )
    corrections: Positive = Field(
        6, description="simulations by which the surrogate's fit may be corrected, one a round"
    )
    simulations: int = Field(
        24, ge=0, description="simulations that a fit by the simulator may make; 0: no such fit"
    )
    repeats: Positive = Field(2, description="further seeds of simulations again at fitted parameters")
    error: float = Field(0.01, gt=0, lt=1, description="standard error of a measured area or width ratio")
    points: Literal[32, 64, 128, 256, 512, 1024] = Field(
        128, description="points at which the surrogate surveys the parameters, for posterior and profiles"
    )
    draws: int = Field(
        8,
        ge=0,
        description="simulations at draws from the posterior: the surrogate's error there, and thickness; "
        "below 5 no thickness",
    )
    joint: tuple[Name, ...] = Field(
        (), description="tissues, two or more of those fitted, to fit together with common parameters too"
    )
    unmeasured: tuple[Name, ...] = Field(
        (), description="tissues of which only the paper's delta is known, to simulate there, not to fit"
    )

    @model_validator(mode="after")
    def _consistent(self) -> "Fit":
        strange = sorted(set(self.joint) - set(self.tissues))
        if strange:
            raise ValueError(f"joint has '{strange[0]}', which is not in tissues; add it there")
        if len(self.joint) == 1 or len(set(self.joint)) < len(self.joint):
            raise ValueError("joint needs two tissues or more, each once; or leave it empty")
        return self
