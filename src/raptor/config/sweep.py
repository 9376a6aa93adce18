"""Sweeps of the parameters on standard moulds: their block of the configuration."""

from pathlib import Path

from pydantic import Field, model_validator

from raptor.core.blocks import Block, Positive
from raptor.dataset.sweep import Grid


class Sweep(Block):
    """Contraction over a grid of parameters, simulated and predicted."""

    moulds: tuple[str, ...] = Field(
        ("four_post_rectangle", "i_shape"),
        description="mould files, each swept over the whole grid",
    )
    mould_scale: float = Field(
        0.7, gt=0, le=1.1, description="moulds are drawn at this fraction of their size"
    )
    deltas: tuple[float, ...] = Field((0.1, 0.5, 0.9), min_length=1, description="values of delta")
    kappa_nnn: tuple[float, ...] = Field(
        (0.1, 0.7), min_length=1, description="values of kappa_nnn, in kappa0"
    )
    ratios: tuple[float, ...] = Field(
        (0.1, 0.7), min_length=1, description="values of kappa_nnnn/kappa_nnn, at most 1/sqrt(2)"
    )
    seeds: Positive = Field(2, description="simulations of each point, for error bars")
    panels: tuple[float, ...] = Field(
        (0.5, 0.9), min_length=1, description="values of delta, among deltas, whose tissues are drawn"
    )

    @model_validator(mode="after")
    def _consistent(self) -> "Sweep":
        self.grid()  # its points are allowed
        for name in ("deltas", "kappa_nnn", "ratios", "panels"):
            values = getattr(self, name)
            if list(values) != sorted(set(values)):
                raise ValueError(f"{name} is {list(values)}; ascending values are needed")
        missing = [delta for delta in self.panels if delta not in self.deltas]
        if missing:
            raise ValueError(f"panels has {missing[0]}, which deltas does not have; add it there")
        if len(self.files()) < len(self.moulds):
            raise ValueError("moulds: two files have the same name; rename one")
        return self

    def files(self) -> dict[str, str]:
        """Mould files by name."""
        return {Path(path).stem: path for path in self.moulds}

    def grid(self) -> Grid:
        """The points of each mould's sweep."""
        return Grid(self.deltas, self.kappa_nnn, self.ratios, self.seeds)
