"""The whole configuration: one model that defines defaults, JSON schema and key table."""

from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from raptor.config.blocks import Fit, Model
from raptor.core.blocks import Block, Name, Positive, content_hash
from raptor.core.version import MODEL_VERSION, STACK_FORMAT
from raptor.dataset.campaign import Campaign, Design, Grid
from raptor.frame import IMAGE_SIZE
from raptor.moulds.families import MouldFamilies
from raptor.moulds.random_moulds import MARGIN, RandomMoulds
from raptor.parameters import LAYERS, NetworkModel
from raptor.studies.tradeoff import SURROGATE, Tradeoff
from raptor.surrogate.rules import BASELINES, SHIPPED

CAMPAIGNS = {
    "paper": Campaign(runs=64, test=12, validation=8, edge=8),
    "replicates": Campaign(repeat_of="paper", runs=3, seeds=2),
    "long_bars": Campaign(moulds="long_bars", runs=2),
    "slender_strips": Campaign(moulds="slender_strips", runs=2),
    "soft_corner": Campaign(runs=2, delta=(0.85, 0.95), kappa_nnn=(0.1, 0.2), kappa_nnnn=(0.01, 0.05)),
    "sweep": Campaign(
        moulds=("four_post_rectangle", "i_shape"),
        grid=Grid(delta=(0.1, 0.5, 0.9), kappa_nnn=(0.1, 0.7), ratio=(0.1, 0.7)),
        seeds=2,
    ),
}
MODELS: dict[str, dict[str, Any]] = {
    "film_unet": {},
    "pix2pix": {"network": "pix2pix", "lambda_l1": 100.0, "ensemble_size": 1},
}


class Configuration(Block):
    """A run of the workflow, from moulds to fitted tissues."""

    name: Name = Field("laptop", description="folder of the results, under results/")
    seed: int = Field(20250206, ge=0, lt=2**63, description="root of every random stream")
    layers: int = Field(LAYERS, ge=1, le=64, description="cell layers between floor and fill height")
    shells: tuple[int, int, int] = Field(
        (1, 2, 3), description="neighbour shells of kappa0, kappa_nnn and kappa_nnnn"
    )
    tension: Literal["hooke", "literal"] = Field(
        "hooke", description="hooke: k (length - L'); literal: k L', the paper's formula"
    )
    accuracy: Literal["draft", "standard", "reference"] = Field(
        "standard", description="accuracy of every simulation: draft, standard or reference"
    )
    pixels: Literal[16, 32, 64, 128, 256, 512] = Field(256, description="side of the square images of fields")
    shard_size: Positive = Field(4, description="simulations per job and file; does not change results")
    check_fraction: float = Field(
        0.1, gt=0, le=1, description="random share of the simulations that checks recompute"
    )
    mould_scale: float = Field(
        1.0, gt=0, le=1.1, description="library moulds are cast at this fraction of their size"
    )
    random_moulds: RandomMoulds = Field(default_factory=lambda: RandomMoulds())
    mould_families: MouldFamilies = Field(default_factory=lambda: MouldFamilies())
    campaigns: dict[Name, Campaign] = Field(
        default_factory=lambda: dict(CAMPAIGNS),
        min_length=1,
        description="everything that is simulated, by name; a new study is one more entry",
    )
    models: dict[Name, Model] = Field(
        default_factory=lambda: dict(MODELS),
        validate_default=True,
        description="models to train and compare, by name; keys not given are as in the first. "
        "Empty: simulate only",
    )
    selected_model: Name | None = Field(
        None,
        description="which of models is the surrogate, that of sweeps, fits and figures; null: the first",
    )
    trained_model: str | None = Field(
        None,
        description="a surrogate trained before, for sweeps, fits and figures: shipped, or a model's folder; "
        "layers and pixels must be those it was made for. Models, if any, are trained and compared with it. "
        "null: one of models",
    )
    fit: Fit = Field(default_factory=lambda: Fit())
    tradeoff: Tradeoff = Field(default_factory=lambda: Tradeoff())
    searches: dict[Name, str] = Field(
        default_factory=dict,
        description="searches for moulds by the surrogate, by name: files as in docs/design.md",
    )

    @model_validator(mode="before")
    @classmethod
    def _train_none(cls, given: Any) -> Any:
        """With a trained model, no model by default."""
        if isinstance(given, dict) and given.get("trained_model") is not None:
            return {"models": {}, **given}
        return given

    @field_validator("models", mode="before")
    @classmethod
    def _like_the_first(cls, given: Any) -> Any:
        return _completed(given) if isinstance(given, dict) else given

    @model_validator(mode="after")
    def _consistent(self) -> "Configuration":
        assert self.network_model  # its shells are allowed
        side = IMAGE_SIZE - 2 * MARGIN
        drawn = any(campaign.kind not in (None, "families") for campaign in self.campaigns.values())
        if drawn and self.random_moulds.cells[1] > 0.9 * side**2 * self.layers:
            raise ValueError(
                f"random_moulds.cells allows {self.random_moulds.cells[1]} cells, more than {self.layers} "
                f"layers hold in an image of {IMAGE_SIZE} l0; lower it or raise layers"
            )
        if self.selected_model is not None and self.selected_model not in self.models:
            raise ValueError(
                f"selected_model is '{self.selected_model}'; allowed are {', '.join(self.models)}"
            )
        if self.trained_model is not None and self.selected_model is not None:
            raise ValueError("selected_model and trained_model both name the surrogate; omit one of them")
        if self.given_model in self.models:
            raise ValueError(f"models has '{self.given_model}', the name of trained_model; rename it")
        for name, campaign in self.campaigns.items():
            self._check_campaign(name, campaign)
        for name, model in self.models.items():
            self._check_model(name, model)
        if self.searches and not self.has_surrogate:
            raise ValueError("searches need a surrogate; give models or trained_model, or no searches")
        self._order()
        for pixels in self.tradeoff.rasters:
            if max(pixels, self.pixels) % min(pixels, self.pixels):
                raise ValueError(
                    f"tradeoff.methods has {pixels} pixels, neither a divisor nor a multiple of pixels "
                    f"({self.pixels}); choose one that is"
                )
        return self

    def _check_campaign(self, name: str, campaign: Campaign) -> None:
        """Check that the campaigns and models that a campaign refers to exist."""
        if campaign.repeat_of is not None:
            repeated = self.campaigns.get(campaign.repeat_of)
            if repeated is None or repeated.repeat_of is not None:
                known = ", ".join(each for each, other in self.campaigns.items() if other.repeat_of is None)
                raise ValueError(f"campaigns.{name}.repeat_of is '{campaign.repeat_of}'; allowed are {known}")
        if campaign.selected_by is not None and campaign.selected_by not in self.models:
            raise ValueError(
                f"campaigns.{name}.selected_by is '{campaign.selected_by}'; allowed are "
                f"{', '.join(self.models) or 'none'}"
            )

    def _check_model(self, name: str, model: Model) -> None:
        """Check that a model's campaigns have the splits it needs, and that initial weights fit it."""
        if name in BASELINES:
            raise ValueError(f"models.{name}: {' and '.join(BASELINES)} are baselines; choose another name")
        for campaign in model.campaigns:
            block = self.campaigns.get(campaign)
            if block is None:
                raise ValueError(
                    f"models.{name}.campaigns has '{campaign}'; allowed are {', '.join(self.campaigns)} "
                    "(or state models: {} to simulate only)"
                )
            if block.kind is None:
                raise ValueError(
                    f"models.{name}.campaigns: {campaign} has no run to train on, since its moulds are "
                    "given; name a campaign of random moulds"
                )
            if block.tests + block.validation >= block.runs:
                raise ValueError(
                    f"models.{name}.campaigns: {campaign} has no run to train on; lower its test or "
                    "validation"
                )
        first = self.campaigns[model.campaigns[0]]
        if not first.validation or not first.tests:
            raise ValueError(
                f"models.{name}.campaigns: {model.campaigns[0]} comes first, so it needs test and validation"
            )
        if model.initial_weights is None:
            return
        initial = self.models.get(model.initial_weights)
        if initial is None:
            raise ValueError(
                f"models.{name}.initial_weights is '{model.initial_weights}'; allowed are "
                f"{', '.join(self.models)}"
            )
        for key in ("network", "base_channels", "pixels"):
            if getattr(model, key) != getattr(initial, key):
                raise ValueError(f"models.{name}.{key} differs from that of its initial_weights")
        if initial.noise not in (0, model.noise):
            raise ValueError(
                f"models.{name}.noise is {model.noise}; its initial_weights has {initial.noise}, so set that"
            )
        if model.ensemble_size > initial.ensemble_size:
            raise ValueError(
                f"models.{name}.ensemble_size is {model.ensemble_size}; its initial_weights has "
                f"{initial.ensemble_size}"
            )
        if model.lambda_l1 is not None:
            raise ValueError(f"models.{name}.initial_weights: no discriminator is kept; set lambda_l1: null")

    def _order(self) -> None:
        """Check that campaigns and models can be made one after another, without a cycle."""
        needs: dict[str, list[str]] = {}
        for name, campaign in self.campaigns.items():
            needs[f"campaigns.{name}"] = [f"models.{each}" for each in (campaign.selected_by,) if each]
        for name, model in self.models.items():
            needs[f"models.{name}"] = [f"campaigns.{each}" for each in model.campaigns]
            needs[f"models.{name}"] += [f"models.{each}" for each in (model.initial_weights,) if each]
        try:
            TopologicalSorter(needs).prepare()
        except CycleError as error:
            raise ValueError(f"each of these depends on the next: {', '.join(error.args[1])}") from error

    @property
    def own_model(self) -> str | None:
        """Name of the model trained here that is shipped and published; None without models."""
        return self.selected_model or next(iter(self.models), None)

    @property
    def given_model(self) -> str | None:
        """Name of the model trained before, in tables and figures; None if none is used."""
        if self.trained_model is None:
            return None
        return "shipped" if self.trained_folder == SHIPPED else "trained"

    @property
    def surrogate(self) -> str | None:
        """Name of the model of sweeps, fits and figures, trained before or here; None without any."""
        return self.given_model or self.own_model

    @property
    def has_surrogate(self) -> bool:
        """Whether there is a surrogate for sweeps and fits."""
        return self.surrogate is not None

    @property
    def trained_folder(self) -> Path | None:
        """The folder of the model trained before; None if none is used."""
        if self.trained_model is None:
            return None
        return SHIPPED if self.trained_model == "shipped" else Path(self.trained_model)

    @property
    def surrogate_fingerprint(self) -> str | None:
        """Hash of the configuration that the surrogate depends on; of its place, if trained before."""
        if self.trained_model is not None:
            return content_hash(self.trained_model)
        return self.model_fingerprint(self.own_model) if self.own_model else None

    @property
    def main_campaign(self) -> str | None:
        """The first campaign of the first model: figures are of its test runs; None without."""
        return next((model.campaigns[0] for model in self.models.values()), None)

    @property
    def tested(self) -> list[str]:
        """Campaigns whose test runs evaluate models: the main one, then the others of random moulds."""
        others = [
            name for name, campaign in self.campaigns.items() if campaign.kind and campaign.tests
            and not campaign.grid and name != self.main_campaign
        ]  # fmt: skip
        return [self.main_campaign, *others] if self.main_campaign else []

    @property
    def learnt(self) -> list[str]:
        """Campaigns that a model is trained on."""
        named = {campaign for model in self.models.values() for campaign in model.campaigns}
        return [name for name in self.campaigns if name in named]

    @property
    def compares_training(self) -> bool:
        """Whether models differ in the data on which they were trained from random weights."""
        data = {(m.campaigns, m.training_fraction) for m in self.models.values() if not m.initial_weights}
        return len(data) > 1

    def origin(self, name: str) -> Model:
        """The model from random weights with which the training of a model began; it scales the fields."""
        model = self.models[name]
        return self.origin(model.initial_weights) if model.initial_weights else model

    def means_until(self, name: str) -> int:
        """Passes, counted from random weights, after which a model's networks sample."""
        model = self.models[name]
        before = self.means_until(model.initial_weights) if model.initial_weights else 0
        return before + (0 if model.noise else model.epochs)

    def design(self, campaign: str) -> Design:
        """All that the design of a campaign depends on, apart from other campaigns and models."""
        block = self.campaigns[campaign]
        drawn_from = self.mould_families if block.kind == "families" else self.random_moulds
        return Design(
            name=campaign,
            seed=self.seed,
            layers=self.layers if block.kind else None,
            mould_scale=self.mould_scale if block.files() else None,
            drawn_from=drawn_from if block.kind else None,
            campaign=block,
        )

    def simulations(self, campaign: str) -> int:
        """Number of simulations of a campaign."""
        block = self.campaigns[campaign]
        if block.repeat_of is None:
            return block.simulations()
        return block.simulations(self.campaigns[block.repeat_of].test_simulations())

    def shards(self, campaign: str) -> list[str]:
        """Names of a campaign's shards: the first and last simulation of each."""
        count, size = self.simulations(campaign), self.shard_size
        return [f"{first:05d}-{min(first + size, count) - 1:05d}" for first in range(0, count, size)]

    @property
    def network_model(self) -> NetworkModel:
        """The network of cells that is simulated."""
        return NetworkModel(self.layers, self.shells, self.tension)

    @property
    def simulator(self) -> dict[str, Any]:
        """All that a simulation depends on, apart from mould, parameters and seed."""
        return self.model_dump(mode="json", include={"layers", "shells", "tension", "accuracy"})

    def trial(self, case: str) -> dict[str, Any]:
        """All that the comparison on a case depends on, apart from the methods and the mould's file."""
        chosen = self.tradeoff.cases[case].model_dump(mode="json")
        kept = {"layers", "shells", "tension", "pixels", "seed", "mould_scale"}
        simulator = self.model_dump(mode="json", include=kept)
        alike = chosen["layers"] in (None, self.layers)
        chosen["layers"] = chosen["layers"] or self.layers
        return simulator | chosen | {"name": case, "surrogate": alike and self.compares_surrogate}

    @property
    def compares_surrogate(self) -> bool:
        """Whether a surrogate is compared with methods of simulation."""
        return self.has_surrogate and SURROGATE in self.tradeoff.methods

    def fingerprint(self, stage: Literal["design", "simulation", "fields"], campaign: str) -> str:
        """Hash of the configuration that a campaign's files of a stage depend on, model version included."""
        block = self.campaigns[campaign]
        design = [
            self.design(campaign).model_dump(mode="json"),
            self.fingerprint("design", block.repeat_of) if block.repeat_of else None,
            self.model_fingerprint(block.selected_by) if block.selected_by else None,
            MODEL_VERSION,
        ]
        simulation = [design, self.simulator]
        stages = {
            "design": design,
            "simulation": simulation,
            "fields": [simulation, self.pixels, STACK_FORMAT],
        }
        return content_hash(stages[stage])

    def model_fingerprint(self, name: str) -> str:
        """Hash of the configuration that each network of a model depends on."""
        model = self.models[name]
        return content_hash(
            [
                [self.fingerprint("fields", campaign) for campaign in model.campaigns],
                model.model_dump(mode="json", exclude={"ensemble_size", "campaigns"}),
                self.model_fingerprint(model.initial_weights) if model.initial_weights else None,
            ]
        )


def _completed(models: dict[str, Any]) -> dict[str, Any]:
    """Models, with keys not given taken from the first."""
    blocks = {name: block if block is not None else {} for name, block in models.items()}
    if not all(isinstance(block, dict) for block in blocks.values()):
        return blocks
    first: dict[str, Any] = next(iter(blocks.values()), {})
    return {name: {**first, **block} for name, block in blocks.items()}
