"""What a search found: moulds, their measures, and the files that a bench needs."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from numpy.typing import NDArray

from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path, write_text
from raptor.fields.metrics import pearson
from raptor.moulds.geojson import write_moulds
from raptor.moulds.geometry import Mould
from raptor.moulds.writing import write_dxf, write_svg
from raptor.optimisation.spec import DesignSpec


@dataclass(frozen=True)
class Designs:
    """Moulds that a search found: what `raptor.design` returns.

    Parameters
    ----------
    spec : DesignSpec
    moulds : tuple of Mould
        The finalists, then those compared with, in the order of the table.
    table : DataFrame
        One row a mould: `design`, `group` (searched or compared), cells, tethers, every measure predicted and
        simulated with its standard deviation, whether it meets the limits, and its `rank`.
    front : DataFrame
        Objectives, as predicted in the search, and genes of every undominated mould.
    progress : DataFrame
        Evaluations, seconds, moulds on the front and the best of each objective, by generation.
    """

    spec: DesignSpec
    moulds: tuple[Mould, ...]
    table: pd.DataFrame
    front: pd.DataFrame
    progress: pd.DataFrame = field(repr=False)

    @property
    def agreement(self) -> dict[str, float]:
        """Correlation of predicted and simulated values over the finalists, by objective; of two none."""
        rows = self.table[self.table["group"] == "searched"]
        if "simulated_meets" not in rows or len(rows) < 3:
            return {}
        pairs = {
            each.label: [
                rows[f"{by}_{each.label}"].to_numpy(dtype=float) for by in ("predicted", "simulated")
            ]
            for each in self.spec.objectives
        }
        return {label: pearson(*pair) for label, pair in pairs.items()}

    def save(self, folder: str | Path) -> Path:
        """Write tables, the specification and each mould as GeoJSON, SVG and DXF to a folder.

        Raises
        ------
        RaptorError
            If a file cannot be written.
        """
        folder = Path(folder)
        try:
            (folder / "moulds").mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RaptorError(f"{folder} cannot be made: {error.strerror}; choose another folder") from error
        tables = {"designs": self.table, "front": self.front, "progress": self.progress}
        for name, table in tables.items():
            with atomic_path(folder / f"{name}.csv") as temporary:
                table.to_csv(temporary, index=False)
        spec = self.spec.model_dump(mode="json", exclude_none=True)
        write_text(folder / "spec.yaml", yaml.safe_dump(spec, sort_keys=False, default_flow_style=None))
        write_moulds(folder / "designs.geojson", self.moulds)
        for mould in self.searched:
            stem = folder / "moulds" / mould.name
            write_moulds(stem.with_suffix(".geojson"), [mould])
            write_svg(stem.with_suffix(".svg"), mould)
            write_dxf(stem.with_suffix(".dxf"), mould)
        return folder

    @property
    def best(self) -> str:
        """Name of the finalist that is best in the first objective, if possible of those within limits."""
        rows = self.table[self.table["group"] == "searched"]
        rows = rows[rows["rank"].notna()] if rows["rank"].notna().any() else rows
        return str(rows["design"].iloc[int(self._costs(rows).argmin())])

    def _costs(self, rows: pd.DataFrame) -> NDArray[np.float64]:
        """The first objective of rows, simulated if it was, smaller is better."""
        first, by = self.spec.objectives[0], "simulated" if "simulated_meets" in rows else "predicted"
        return first.sign * rows[f"{by}_{first.label}"].to_numpy(dtype=float)

    @property
    def searched(self) -> Sequence[Mould]:
        """The finalists alone."""
        count = int((self.table["group"] == "searched").sum())
        return self.moulds[:count]

    def __str__(self) -> str:
        first = self.spec.objectives[0]
        by = "simulated" if "simulated_meets" in self.table else "predicted"
        good = self.table[self.table["rank"].notna()]
        parts = {group: good[good["group"] == group] for group in ("searched", "compared")}
        said = ", ".join(
            f"{group} {first.sign * self._costs(part).min():.3f}"
            for group, part in parts.items()
            if len(part)
        )
        last = self.progress.iloc[-1]
        rate = last["evaluations"] / last["seconds"]
        agree = "".join(
            f"; r of {label} {value:.2f} between prediction and simulation"
            for label, value in self.agreement.items()
        )
        return (
            f"{int(last['evaluations']):,} moulds in {last['seconds']:.0f} s ({rate:.0f} a second), "
            f"{len(self.front)} on the front; best {first.label}, {by}: {said or 'none within limits'}{agree}"
        )
