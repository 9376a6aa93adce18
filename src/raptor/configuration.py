"""The typed configuration: one model from which defaults, JSON schema and key table are made."""

import hashlib
import json
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import yaml
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from raptor import MODEL_VERSION
from raptor.condor.accuracy import accuracy_named
from raptor.condor.lattice import cast_sites
from raptor.dataset.design import DesignRules
from raptor.errors import RaptorError
from raptor.morphology import central_section
from raptor.moulds.geojson import read_mould
from raptor.moulds.geometry import IMAGE_SIZE, SMALLEST_TETHER
from raptor.moulds.random_moulds import RandomMoulds
from raptor.parameters import (
    DELTA,
    KAPPA_NNN,
    KAPPA_NNNN,
    Bounds,
    CellParameters,
    NetworkModel,
    largest_kappa_nnnn,
)

AccuracyName = Literal["draft", "standard", "reference"]
Name = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")]
Positive = Annotated[int, Field(ge=1)]
Weight = Annotated[float, Field(ge=0)]


def _accuracy(name: str) -> str:
    accuracy_named(name)
    return name


Method = Annotated[str, AfterValidator(_accuracy)]


class Block(BaseModel):
    """A block of the configuration: unknown keys are errors, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


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


class Surrogate(Block):
    """The network and its training.

    pix2pix trains with a learning rate of 2e-4 and an L1 weight of 100; on a few dozen moulds, whose
    fields fill little of [-1, 1], the defaults here did better on the validation moulds.
    """

    model: Name = Field("pix2pix", description="name of the model's folder")
    base_channels: int = Field(16, ge=1, le=256, description="channels of the first layer (pix2pix: 64)")
    dropout: float = Field(0.5, ge=0, lt=1, description="in the three deepest decoder layers")
    patch_layers: int = Field(3, ge=1, le=5, description="strided layers of the discriminator")
    epochs: Positive = Field(70, description="passes over the augmented examples")
    batch_size: int = Field(4, ge=2, description="examples a step")
    learning_rate: float = Field(1e-3, gt=0, lt=1, description="of Adam, for both networks (pix2pix: 2e-4)")
    beta1: float = Field(0.5, ge=0, lt=1, description="of Adam")
    lambda_l1: float = Field(1000.0, ge=0, description="weight of the L1 term (pix2pix: 100)")
    threads: Positive = Field(2, description="processor threads of training and prediction")


class Fit(Block):
    """Which tissues are fitted, and how."""

    tissues_file: str = Field("config/tissues.yaml", description="measured tissues and their moulds")
    tissues: tuple[Name, ...] = Field(("glial_1",), description="tissues to fit, by name")
    mould_scale: float = Field(
        0.7, gt=0, le=1.5, description="tissue moulds are drawn at this fraction of their size"
    )
    starts: Literal[16, 32, 64, 128, 256] = Field(
        64, description="points of the Sobol sequence from which fits start"
    )


class TradeoffCase(Block):
    """A mould and parameters to compare on."""

    name: Name = Field(description="name of the case")
    mould: str = Field(description="mould file")
    delta: float = Field(description="cell-matrix interaction")
    kappa_nnn: float = Field(description="second spring constant, kappa0")
    kappa_nnnn: float = Field(description="third spring constant, kappa0")
    layers: int | None = Field(None, ge=1, le=64, description="layers, where not model.layers")
    methods: tuple[Method, ...] = Field((), description="further methods, of this case alone")

    @model_validator(mode="after")
    def _consistent(self) -> "TradeoffCase":
        CellParameters(self.delta, self.kappa_nnn, self.kappa_nnnn)
        return self


SMALL = {"mould": "config/moulds/small_rectangle.geojson"}


class Tradeoff(Block):
    """The comparison of speed and accuracy."""

    methods: tuple[Method, ...] = Field(
        ("draft", "standard", "anneal-1e3"), description="accuracies to compare"
    )
    layers: tuple[Positive, ...] = Field((), description="other numbers of layers to compare")
    shells: tuple[tuple[int, int, int], ...] = Field((), description="other shells to compare")
    pixels: tuple[Positive, ...] = Field((), description="other rasters to compare")
    seeds: int = Field(4, ge=4, description="reference runs that measure the seed-to-seed spread")
    surrogate: bool = Field(True, description="compare the trained surrogate too")
    folding_case: Name = Field("soft", description="case whose folded and unfolded state are drawn")
    folding_method: Method = Field("anneal-1e4", description="method that folds it")
    cases: tuple[TradeoffCase, ...] = Field(
        (
            TradeoffCase(name="middle", delta=0.5, kappa_nnn=0.5, kappa_nnnn=0.3, **SMALL),
            TradeoffCase(name="soft", delta=0.9, kappa_nnn=0.1, kappa_nnnn=0.01, **SMALL),
        ),
        min_length=1,
        description="moulds and parameters to compare on",
    )

    @model_validator(mode="after")
    def _consistent(self) -> "Tradeoff":
        names = [case.name for case in self.cases]
        if len(set(names)) < len(names):
            raise ValueError("cases: two have the same name; give each its own")
        if self.folding_case not in names:
            known = ", ".join(names)
            raise ValueError(f"folding_case is '{self.folding_case}'; cases are {known}")
        for shells in self.shells:
            NetworkModel(1, shells)
        for layers in self.layers:
            NetworkModel(layers)
        return self


class Configuration(Block):
    """A data set factory's run, from moulds to fitted tissues."""

    name: Name = Field("laptop", description="folder of the results, under results/")
    seed: int = Field(20250206, ge=0, lt=2**63, description="root of every random stream")
    design: Design = Field(default_factory=lambda: Design())
    moulds: Moulds = Field(default_factory=lambda: Moulds())
    model: Model = Field(default_factory=lambda: Model())
    simulation: Simulation = Field(default_factory=lambda: Simulation())
    fields: Fields = Field(default_factory=lambda: Fields())
    dataset: Dataset = Field(default_factory=lambda: Dataset())
    surrogate: Surrogate = Field(default_factory=lambda: Surrogate())
    fit: Fit = Field(default_factory=lambda: Fit())
    tradeoff: Tradeoff = Field(default_factory=lambda: Tradeoff())

    @model_validator(mode="after")
    def _consistent(self) -> "Configuration":
        side = IMAGE_SIZE - 2 * self.moulds.margin
        if self.moulds.cells[1] > 0.9 * side**2 * self.model.layers:
            raise ValueError(
                f"moulds.cells allows {self.moulds.cells[1]} cells, more than {self.model.layers} "
                f"layers hold in an image of {IMAGE_SIZE} l0; lower it or raise model.layers"
            )
        for pixels in self.tradeoff.pixels:
            if max(pixels, self.fields.pixels) % min(pixels, self.fields.pixels):
                raise ValueError(
                    f"tradeoff.pixels has {pixels}, no whole part or multiple of fields.pixels "
                    f"({self.fields.pixels}); choose one that is"
                )
        return self

    @property
    def shards(self) -> list[str]:
        """Names of the shards: the first and the last simulation of each."""
        size, last = self.simulation.shard_size, self.design.simulations - 1
        return [f"{i:05d}-{min(i + size - 1, last):05d}" for i in range(0, last + 1, size)]

    def network_model(self) -> NetworkModel:
        """The model of the simulations."""
        return NetworkModel(self.model.layers, self.model.shells, self.model.tension)

    def comparison(self, case: TradeoffCase) -> dict[str, Any]:
        """All that the comparison on one case hangs on, for the rule that makes it."""
        model = self.model.model_dump(mode="json")
        model["layers"] = self.model.layers if case.layers is None else case.layers
        shared = self.tradeoff.model_dump(
            mode="json", include={"methods", "layers", "shells", "pixels", "seeds"}
        )
        shared["methods"] = list(dict.fromkeys([*shared["methods"], *case.methods]))
        alike = case.layers in (None, self.model.layers)
        return {
            "case": case.model_dump(mode="json", exclude={"methods"}),
            "model": model,
            "pixels": self.fields.pixels,
            "seed": self.seed,
            "comparison": shared,
            "surrogate": self.tradeoff.surrogate and alike,
        }

    def random_moulds(self) -> RandomMoulds:
        """What moulds are drawn from."""
        m = self.moulds
        symmetry: dict[str, float] = {str(k): v for k, v in m.symmetry.items()}
        return RandomMoulds(
            m.cells, self.model.layers, m.tethers, m.tether_radius, m.arm_width, m.margin, symmetry
        )

    def design_rules(self) -> DesignRules:
        """What the design is drawn from."""
        d = self.design
        ranges = (Bounds(*d.delta), Bounds(*d.kappa_nnn), Bounds(*d.kappa_nnnn))
        return DesignRules(d.simulations, d.test, d.validation, d.edge, *ranges)

    def fingerprint(self, stage: str) -> str:
        """Hash of the configuration that a stage's files depend on, model version included."""
        return content_hash(self._depends(stage))

    def _depends(self, stage: str) -> Any:
        dump = self.model_dump(mode="json")
        design = [self.seed, dump["design"], dump["moulds"], self.model.layers, MODEL_VERSION]
        simulation = [design, dump["model"], self.simulation.accuracy]
        dataset = [simulation, dump["fields"]]
        surrogate = [dataset, dump["surrogate"]]
        stages = {
            "design": design,
            "simulation": simulation,
            "dataset": dataset,
            "surrogate": surrogate,
        }
        return stages[stage]


class Tissue(Block):
    """A tissue that was measured, and the mould it grew in."""

    description: str = Field(description="cells, gel and source of the measurement")
    mould: str = Field(description="mould file, an approximation documented in it")
    area_ratio: float | None = Field(None, gt=0, le=1.5, description="A/A0")
    width_ratio: float | None = Field(None, gt=0, le=1.5, description="w/w0")
    paper: dict[str, float] = Field(default_factory=dict, description="the paper's fit")

    @model_validator(mode="after")
    def _measured(self) -> "Tissue":
        if self.area_ratio is None and self.width_ratio is None:
            raise ValueError("neither area_ratio nor width_ratio is given; a fit needs one of them")
        return self


def content_hash(content: Any) -> str:
    """Short hash of anything that JSON can hold."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def parse(content: Any, where: str) -> Configuration:
    """Validate a configuration.

    Raises
    ------
    RaptorError
        One sentence a fault; an unknown key is named with its nearest known one.
    """
    try:
        return Configuration.model_validate(content)
    except ValidationError as error:
        raise RaptorError("; ".join(_explain(error, where, Configuration))) from None


def load(path: Path) -> Configuration:
    """Read and validate a configuration file."""
    return parse(_read_yaml(Path(path)), str(path))


def load_tissues(
    path: Path, names: tuple[str, ...] | None = None, mould_scale: float = 1.0
) -> dict[str, Tissue]:
    """Read tissues, all or those named; their moulds are cast and measured at the scale given.

    Raises
    ------
    RaptorError
        Where the file, a tissue in it or its mould cannot be used.
    """
    content = _read_yaml(Path(path))
    chosen = {}
    for name in names if names is not None else content:
        if name not in content:
            near = get_close_matches(name, content, 1)
            hint = f"; did you mean '{near[0]}'?" if near else f"; known are {', '.join(content)}"
            raise RaptorError(f"{path} has no tissue '{name}'{hint}")
        try:
            chosen[name] = Tissue.model_validate(content[name])
        except ValidationError as error:
            raise RaptorError("; ".join(_explain(error, f"{path}, {name}", Tissue))) from None
        _require_measurable(chosen[name], name, mould_scale)
    return chosen


def require_castable(cases: tuple[TradeoffCase, ...]) -> None:
    """Find out before any work that the moulds of a comparison can be read and cast.

    Raises
    ------
    RaptorError
        Where a mould cannot.
    """
    for case in cases:
        cast_sites(read_mould(Path(case.mould)), 1)


def _require_measurable(tissue: Tissue, name: str, scale: float) -> None:
    """Find out before any work that a tissue's mould can be cast, and its width measured."""
    mould = read_mould(Path(tissue.mould)).scaled(scale)
    cast_sites(mould, 1)
    if tissue.width_ratio is not None and not central_section(mould).intersects(mould.depression):
        raise RaptorError(
            f"tissue {name}: a width ratio is given, but tethers fill the central section of "
            f"{tissue.mould}; leave the width out or change the mould"
        )


def _read_yaml(path: Path) -> dict[str, Any]:
    try:
        content = yaml.safe_load(path.read_text())
    except OSError as error:
        raise RaptorError(f"{path} cannot be read: {error.strerror}; check the path") from error
    except yaml.YAMLError as error:
        raise RaptorError(f"{path} is not YAML: {' '.join(str(error).split())}") from error
    if not isinstance(content, dict):
        raise RaptorError(f"{path} holds no keys; see config/README.md for what it may hold")
    return content


def _explain(error: ValidationError, where: str, model: type[BaseModel]) -> Iterator[str]:
    for fault in error.errors():
        place = ".".join(str(part) for part in fault["loc"])
        if fault["type"] == "extra_forbidden":
            known = _keys_beside(model, fault["loc"])
            near = get_close_matches(str(fault["loc"][-1]), known, 1)
            hint = f"did you mean '{near[0]}'?" if near else f"known are {', '.join(known)}"
            yield f"{where}: unknown key '{place}'; {hint}"
        else:
            message = fault["msg"].removeprefix("Value error, ")
            given = f" (given: {fault['input']!r})" if fault["type"] != "value_error" else ""
            yield f"{where}: {place + ': ' if place else ''}{message}{given}"


def _keys_beside(model: type[BaseModel], place: tuple[int | str, ...]) -> list[str]:
    """Names of the keys that may stand where an unknown one was found."""
    for part in place[:-1]:
        if isinstance(part, int):  # an item of a list: its model is known already
            continue
        block = model.model_fields[part].annotation
        block = next((inner for inner in get_args(block) if isinstance(inner, type)), block)
        if not (isinstance(block, type) and issubclass(block, BaseModel)):
            return []
        model = block
    return list(model.model_fields)
