"""Blocks that say which models are trained and which tissues are fitted."""

from pydantic import Field, model_validator

from raptor.core.blocks import Block, Name
from raptor.surrogate.rules import ModelRules


class Model(ModelRules):
    """A model, and the campaigns that it learns from."""

    campaigns: tuple[Name, ...] = Field(
        ("paper",),
        min_length=1,
        description="campaigns whose training runs it learns from; the first one also validates and tests it",
    )


class Fit(Block):
    """Which tissues are fitted, and how far the simulator takes part."""

    tissues_file: str | None = Field(
        None, description="measured tissues and their moulds; null: those that come with the package"
    )
    tissues: tuple[Name, ...] = Field(("glial_1",), description="tissues to fit, by name")
    joint: tuple[Name, ...] = Field(
        (), description="tissues, two or more of those fitted, to fit together with common parameters too"
    )
    simulations: int = Field(
        24, ge=0, description="simulations that a fit by the simulator may make; 0: no such fit"
    )

    @model_validator(mode="after")
    def _consistent(self) -> "Fit":
        strange = sorted(set(self.joint) - set(self.tissues))
        if strange:
            raise ValueError(f"joint has '{strange[0]}', which is not in tissues; add it there")
        if len(self.joint) == 1 or len(set(self.joint)) < len(self.joint):
            raise ValueError("joint needs two tissues or more, each once; or leave it empty")
        return self
