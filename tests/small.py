"""A campaign small enough to be made in seconds, without the workflow; real in every part."""

from pathlib import Path

from raptor.config import Configuration
from raptor.dataset.design import write_design
from raptor.dataset.examples import list_examples, write_examples
from raptor.dataset.run import simulate_shard
from raptor.dataset.shards import write_shard
from raptor.dataset.stack import build_stack
from raptor.moulds import write_moulds

ROOT = Path(__file__).parents[1]
MINI = ROOT / "tests" / "data" / "mini"  # results of the workflow, kept: tests/data/make_mini
CAMPAIGN = MINI / "campaigns" / "paper"

CONFIG = Configuration.model_validate(
    {
        "name": "unit",
        "layers": 2,
        "pixels": 32,
        "random_moulds": {"cells": [60, 250], "tethers": [0, 3]},
        "campaigns": {"paper": {"runs": 6, "test": 2, "validation": 1, "edge": 2}},
    }
)
MODEL = CONFIG.network_model


def design(campaign="paper", **changes):
    """The design of the campaign above, or of one with other keys."""
    given = CONFIG.design("paper")
    block = type(given.campaign).model_validate(given.campaign.model_dump(exclude_unset=True) | changes)
    return given.model_copy(update={"name": campaign, "campaign": block})


def build(folder, size, given=None, base=None):
    """A campaign's folder without the workflow, in shards of some size."""
    runs, moulds = (given or design()).make(base)
    folder.mkdir(parents=True)
    write_design(folder / "design.csv", runs)
    write_moulds(folder / "moulds.geojson", moulds)
    by_name = {mould.name: mould for mould in moulds}
    shards = []
    for start in range(0, len(runs), size):
        part = runs[start : start + size]
        shards.append(folder / "shards" / f"{start}.nc")
        simulations, failures = simulate_shard(part, by_name, MODEL, "draft")
        write_shard(shards[-1], part, simulations, MODEL, "draft", "c", failures)
    stack = folder / "fields.nc"
    build_stack(stack, shards, runs, by_name, 32, simulation_configuration="c", configuration="d")
    write_examples(folder / "examples.csv", list_examples(stack))
    return folder
