"""The comparison of speed and accuracy: its blocks of the configuration."""

from pydantic import Field, model_validator

from raptor.config.blocks import Method
from raptor.core.blocks import Block, Name, Positive
from raptor.parameters import CellParameters, NetworkModel


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


SMALL = {"mould": "small_rectangle"}


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
