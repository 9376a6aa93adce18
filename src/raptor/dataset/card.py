"""The card of a campaign, generated from its data."""

import os
import platform
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from raptor.core.version import MODEL_VERSION, __version__
from raptor.dataset.design import SPLITS, Run
from raptor.dataset.examples import Example
from raptor.dataset.netcdf import LICENCE_URL, REFERENCES
from raptor.dataset.shards import Shard
from raptor.dataset.stack import read_table
from raptor.fields.labelled import LONG_NAMES
from raptor.moulds.geometry import Mould

TEMPLATE = """# Campaign: {name}

**What it is.** {simulations} CONDOR simulations of cell-laden hydrogels that contract in {moulds} tethered
moulds, and their eight fields as images.

**Equations.** Energy of a bond: k/2 (|l| - L')^2 with L' = L (1 - Delta/2 (2 - (u.s_i)^2 -
(u.s_j)^2)); fields: Z_p = sum over cells of z_i w_ip, w a Gaussian of 3 x 125/512 l0 integrated over
the pixel.

## Counts
| split | simulations | examples after augmentation by D4 |
| --- | --- | --- |
{split_rows}

Moulds by symmetry: {symmetry}. Distinct images per simulation of train and validation: {distinct}.
Cells per tissue: {cells}. Images: {pixels} x {pixels} pixels.

## Fields
| field | meaning |
| --- | --- |
{field_rows}

## Parameter ranges
| parameter | smallest | median | largest |
| --- | --- | --- | --- |
{parameter_rows}

## Model choices
Layers: {layers}. Shells of kappa0, kappa_nnn, kappa_nnnn: {shells}. Tension: {tension}. Tethers and
outline are walls that cells cannot enter; the gel is free between floor and fill height. Solver
accuracy: {accuracy}. RAPTOR {version}, model version {model_version}.

## Cost
{hours:.3f} {unit} in all; per simulation {median:.2f} s (median), {p95:.2f} s (95th percentile),
{where}. Not converged: {unconverged} of {simulations}. Largest share of a
tissue's bonds that inverted: {inverted:.2g}. Tissues that lost a tether: {lost}. Simulations of the
design that failed and are missing: {missing}.

## How to evaluate another simulator against it
Simulate the moulds of `moulds.geojson` at the parameters of `design.csv`, rasterise as above, and compare
with `fields.nc` by VRMSE over the test split. The sign of sxsz and sysz is spontaneous: compare their
magnitude.

Licence of the data: [CC BY 4.0]({licence_url}). Reference: {references}.
"""


def card(
    name: str,
    runs: list[Run],
    moulds: list[Mould],
    shards: Iterable[Shard],
    stack: Path,
    examples: list[Example],
) -> str:
    """The card, in Markdown."""
    table = read_table(stack)
    shard, times, inverted, unconverged = None, [], 0.0, 0
    failures: dict[int, str] = {}
    for shard in shards:
        times += [record.wall_time for record in shard.records]
        failures |= shard.failures
        inverted = max([inverted, *(record.inverted_fraction for record in shard.records)])
        unconverged += sum(not record.converged for record in shard.records)
    assert shard is not None  # a data set has at least one shard
    augmented = Counter(table.split[example.sample] for example in examples)
    simulated = Counter(table.split)
    learnt = simulated["train"] + simulated["validation"]
    return TEMPLATE.format(
        name=name,
        simulations=len(table.split),
        split_rows=_rows([s, simulated[s], augmented[s] or "-"] for s in SPLITS),
        symmetry=", ".join(f"{k} {v}" for k, v in Counter(m.symmetry for m in moulds).most_common()),
        moulds=len(moulds),
        distinct=f"{len(examples) / learnt:.2f}" if learnt else "-",
        cells=f"{table.n_cells.min()} to {table.n_cells.max()}, median {np.median(table.n_cells):.0f}",
        pixels=table.pixels,
        field_rows=_rows(LONG_NAMES.items()),
        parameter_rows=_rows(_parameter_rows(runs)),
        layers=shard.model.layers,
        shells=list(shard.model.shells),
        tension=shard.model.tension,
        accuracy=shard.accuracy,
        version=__version__,
        model_version=MODEL_VERSION,
        hours=sum(times) / 3600,
        median=np.median(times),
        p95=np.percentile(times, 95),
        unit="core-hours" if shard.device == "cpu" else "hours of a GPU",
        where=f"on one core of {platform.machine()} with {os.cpu_count()} cores"
        if shard.device == "cpu"
        else "each as a share, by evaluations and cells, of its batch's time on the GPU",
        unconverged=unconverged,
        missing="; ".join(f"{n} ({reason})" for n, reason in sorted(failures.items())) or "none",
        inverted=inverted,
        lost=int(np.count_nonzero(table.measures["posts_lost"])),
        references=REFERENCES,
        licence_url=LICENCE_URL,
    )


def _parameter_rows(runs: list[Run]) -> Iterable[list[object]]:
    for name in ("delta", "kappa_nnn", "kappa_nnnn"):
        values = [getattr(run.parameters, name) for run in runs]
        yield [name, *(f"{v:.4f}" for v in (min(values), np.median(values), max(values)))]


def _rows(rows: Iterable[Iterable[object]]) -> str:
    return "\n".join("| " + " | ".join(str(cell) for cell in row) + " |" for row in rows)
