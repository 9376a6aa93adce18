"""Configuration blocks of models and fits."""

from pydantic import Field, model_validator

from raptor.core.blocks import Block, Name
from raptor.surrogate.rules import ModelRules


class Model(ModelRules):
    """A model and the campaigns that it is trained on."""

    campaigns: tuple[Name, ...] = Field(
        ("paper",),
        min_length=1,
        description="campaigns whose training runs it is trained on; their validation runs choose its "
        "weights and calibrate it",
    )
    training_fraction: float = Field(
        1.0, gt=0, le=1, description="share of each campaign's training runs that it is trained on"
    )


class Fit(Block):
    """Which tissues are fitted, and the budget of simulations."""

    tissues_file: str | None = Field(
        None, description="measured tissues and their moulds; null: those of the package"
    )
    tissues: tuple[Name, ...] = Field(("glial_1",), description="tissues to fit, by name")
    joint: tuple[Name, ...] = Field(
        (), description="two or more of the fitted tissues, to fit also with common parameters"
    )
    simulations: int = Field(
        24, ge=0, description="largest number of simulations in a fit by the simulator; 0: no such fit"
    )

    @model_validator(mode="after")
    def _consistent(self) -> "Fit":
        strange = sorted(set(self.joint) - set(self.tissues))
        if strange:
            raise ValueError(f"joint has '{strange[0]}', which is not in tissues; add it there")
        if len(self.joint) == 1 or len(set(self.joint)) < len(self.joint):
            raise ValueError("joint needs two tissues or more, each once; or leave it empty")
        return self
