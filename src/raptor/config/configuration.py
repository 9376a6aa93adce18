"""The whole configuration: one model from which defaults, JSON schema and key table are made."""

import hashlib
import json
from typing import Any

from pydantic import Field, model_validator

from raptor.condor.simulate import accuracy_named
from raptor.config.blocks import Dataset, Design, Fields, Fit, Further, Model, Moulds, Simulation, Surrogate
from raptor.config.sweep import Sweep
from raptor.config.tradeoff import Tradeoff, TradeoffCase
from raptor.core.blocks import Block, Name
from raptor.core.device import Device
from raptor.core.version import MODEL_VERSION, STACK_FORMAT
from raptor.dataset.design import DesignRules
from raptor.frame import IMAGE_SIZE
from raptor.moulds.random_moulds import RandomMoulds
from raptor.parameters import Bounds, NetworkModel


class Configuration(Block):
    """A data set factory's run, from moulds to fitted tissues."""

    name: Name = Field("laptop", description="folder of the results, under results/")
    seed: int = Field(20250206, ge=0, lt=2**63, description="root of every random stream")
    device: Device = Field(
        "auto",
        description="where simulations and images are made and networks trained; auto: on a GPU where a "
        "job is given one (profiles gpu and slurm) and sees it",
    )
    design: Design = Field(default_factory=lambda: Design())
    moulds: Moulds = Field(default_factory=lambda: Moulds())
    model: Model = Field(default_factory=lambda: Model())
    simulation: Simulation = Field(default_factory=lambda: Simulation())
    fields: Fields = Field(default_factory=lambda: Fields())
    dataset: Dataset = Field(default_factory=lambda: Dataset())
    surrogate: Surrogate = Field(default_factory=lambda: Surrogate())
    compared: dict[Name, dict[str, Any]] = Field(
        {"pix2pix": {"network": "pix2pix", "adversarial": 1.0, "beta1": 0.5}},
        description="further models to compare: what surrogate is, but for the keys given, and one network",
    )
    chosen: Name | None = Field(
        None,
        description="the model that tissues are fitted and figures drawn by, and that is shipped; "
        "null: surrogate.model",
    )
    further: Further = Field(default_factory=lambda: Further())
    fit: Fit = Field(default_factory=lambda: Fit())
    sweep: Sweep = Field(default_factory=lambda: Sweep())
    tradeoff: Tradeoff = Field(default_factory=lambda: Tradeoff())

    @model_validator(mode="after")
    def _consistent(self) -> "Configuration":
        side = IMAGE_SIZE - 2 * self.moulds.margin
        if self.moulds.cells[1] > 0.9 * side**2 * self.model.layers:
            raise ValueError(
                f"moulds.cells allows {self.moulds.cells[1]} cells, more than {self.model.layers} "
                f"layers hold in an image of {IMAGE_SIZE} l0; lower it or raise model.layers"
            )
        if self.device == "cuda" and not accuracy_named(self.simulation.accuracy).contracts_alone:
            raise ValueError(
                "device is cuda, where simulations are contracted at draft or standard; for accuracy: "
                f"{self.simulation.accuracy} choose device: auto or cpu"
            )
        for name, model in self.models.items():
            if model.extra and not self.further.extra:
                raise ValueError(
                    f"{name}.extra is {model.extra}, of which there are no simulations; raise further.extra"
                )
            if model.extra and name == self.surrogate.model:
                raise ValueError("surrogate.extra: the enriched set is chosen by surrogate; use compared")
            if model.initial_weights:
                self._can_continue(name, model)
        if self.chosen_model not in self.models:
            raise ValueError(f"chosen is '{self.chosen}'; allowed are {', '.join(self.models)}")
        for pixels in self.tradeoff.pixels:
            if max(pixels, self.fields.pixels) % min(pixels, self.fields.pixels):
                raise ValueError(
                    f"tradeoff.pixels has {pixels}, no whole part or multiple of fields.pixels "
                    f"({self.fields.pixels}); choose one that is"
                )
        return self

    def _can_continue(self, name: str, model: Surrogate) -> None:
        """A model goes on from one listed before it, so that there is no circle, and of its architecture."""
        earlier = list(self.models)[: list(self.models).index(name)]
        if model.initial_weights not in earlier:
            raise ValueError(
                f"{name}.initial_weights is '{model.initial_weights}', no model listed before it; allowed "
                f"are {', '.join(earlier) or 'none'}"
            )
        begun = self.models[model.initial_weights]
        for key in ("network", "base_channels", "pixels"):
            if getattr(model, key) != getattr(begun, key):
                raise ValueError(f"{name}.{key} differs from that of {begun.model}, which it starts from")
        if model.ensemble_size > begun.ensemble_size:
            raise ValueError(
                f"{name}.ensemble_size is {model.ensemble_size}; {begun.model}, which it starts from, "
                f"has {begun.ensemble_size}"
            )
        if model.adversarial:
            raise ValueError(f"{name}.initial_weights: no discriminator is kept; set adversarial: 0")

    @property
    def chosen_model(self) -> str:
        """Name of the model that tissues are fitted by, and that is shipped."""
        return self.chosen or self.surrogate.model

    @property
    def shards(self) -> list[str]:
        """Names of the design's shards."""
        return self.shards_of(self.design.simulations)

    def shards_of(self, simulations: int) -> list[str]:
        """Names of the shards of so many simulations: the first and the last of each."""
        size, last = self.simulation.shard_size, simulations - 1
        return [f"{i:05d}-{min(i + size - 1, last):05d}" for i in range(0, last + 1, size)]

    @property
    def models(self) -> dict[str, Surrogate]:
        """Every model to be trained, by name: the surrogate first, then those compared with it."""
        shared = self.surrogate.model_dump(mode="json") | {"ensemble_size": 1}
        found = {self.surrogate.model: self.surrogate}
        for name, changes in self.compared.items():
            if name in found:
                raise ValueError(f"compared.{name} has the name of surrogate.model; choose another")
            unknown = sorted(set(changes) - set(shared))
            if unknown:
                raise ValueError(
                    f"compared.{name} has the key '{unknown[0]}'; allowed are the keys of surrogate"
                )
            found[name] = Surrogate.model_validate(shared | changes | {"model": name})
        return found

    @property
    def further_sets(self) -> dict[str, int]:
        """Simulations of each further set that is not empty, by name."""
        f = self.further
        repeated = min(f.floor, self.design.test)
        sizes = {"floor": repeated * f.seeds, "bars": f.bars, "slender": f.slender, "corner": f.corner}
        sizes |= dict.fromkeys(("enriched", "random"), f.extra)
        return {name: size for name, size in sizes.items() if size}

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

    def dump_drawn(self, *further: str) -> dict[str, Any]:
        """What designs are drawn from, and further blocks by name, for the rules that draw them."""
        blocks: Any = {"seed": True, "design": True, "moulds": True, "model": {"layers"}}
        return self.model_dump(mode="json", include=blocks | dict.fromkeys(further, True))

    def design_rules(self) -> DesignRules:
        """What the design is drawn from."""
        d = self.design
        ranges = (Bounds(*d.delta), Bounds(*d.kappa_nnn), Bounds(*d.kappa_nnnn))
        return DesignRules(d.simulations, d.test, d.validation, d.edge, *ranges)

    def fingerprint(self, stage: str) -> str:
        """Hash of the configuration that a stage's files depend on, model version included."""
        return content_hash(self._depends(stage))

    def further_fingerprint(self, name: str) -> str:
        """Hash of the configuration that a further set depends on."""
        own = {"floor": self.further.seeds, "enriched": self.further.candidates}.get(name)
        return content_hash([self._depends("dataset"), name, self.further_sets[name], own])

    def sweep_fingerprint(self) -> str:
        """Hash of the configuration that simulations of sweeps depend on, model version included."""
        own = self.sweep.model_dump(mode="json", exclude={"moulds", "panels"})
        model = self.model.model_dump(mode="json")
        return content_hash([self.seed, own, model, self.simulation.accuracy, MODEL_VERSION])

    def model_fingerprint(self, name: str) -> str:
        """Hash of the configuration that each member of a model depends on, and the one it continues."""
        model = self.models[name]
        own = model.model_dump(mode="json", exclude={"ensemble_size"})
        begun = self.model_fingerprint(model.initial_weights) if model.initial_weights else None
        return content_hash([self._depends("dataset"), own, begun])

    def _depends(self, stage: str) -> Any:
        dump = self.model_dump(mode="json")
        design = [self.seed, dump["design"], dump["moulds"], self.model.layers, MODEL_VERSION]
        simulation = [design, dump["model"], self.simulation.accuracy]
        dataset = [simulation, dump["fields"], STACK_FORMAT]
        stages = {
            "design": design,
            "simulation": simulation,
            "dataset": dataset,
        }
        return stages[stage]


def content_hash(content: Any) -> str:
    """Short hash of anything that JSON can hold."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]
