"""A data set small enough to be made in seconds, without the workflow; real in every part."""

from pathlib import Path

from raptor.config import Configuration
from raptor.dataset.design import sample_design, write_design
from raptor.dataset.examples import augment, training_scaling, write_examples
from raptor.dataset.run import simulate_shard
from raptor.dataset.scaling import write_scaling
from raptor.dataset.shards import write_shard
from raptor.dataset.stack import build_stack
from raptor.moulds import write_moulds

ROOT = Path(__file__).parents[1]
MINI = ROOT / "tests" / "data" / "mini"  # a data set that the workflow made: docs/tutorial.md

CONFIG = Configuration.model_validate(
    {
        "name": "unit",
        "design": {"simulations": 6, "test": 2, "validation": 1, "edge": 2},
        "moulds": {
            "cells": [60, 250],
            "tethers": [0, 3],
            "tether_radius": [0.6, 0.8],
            "arm_width": 3.0,
        },
        "model": {"layers": 2},
        "fields": {"pixels": 32},
    }
)
MODEL = CONFIG.network_model()


def build(folder, size):
    """A results folder without the workflow, in shards of some size."""
    runs, moulds = sample_design(CONFIG.design_rules(), CONFIG.random_moulds(), CONFIG.seed)
    (folder / "design").mkdir(parents=True)
    write_design(folder / "design" / "design.csv", runs)
    write_moulds(folder / "design" / "moulds.geojson", moulds)
    by_name = {mould.name: mould for mould in moulds}
    shards = []
    for start in range(0, len(runs), size):
        part = runs[start : start + size]
        shards.append(folder / "simulations" / f"{start}.nc")
        simulations, failures = simulate_shard(part, by_name, MODEL, "draft")
        write_shard(shards[-1], part, simulations, MODEL, "draft", "c", failures)
    stack = folder / "dataset" / "fields.nc"
    build_stack(stack, shards, runs, by_name, 32, simulation_configuration="c", configuration="d")
    write_examples(folder / "dataset" / "examples.csv", augment(stack))
    write_scaling(folder / "dataset" / "normalisation.json", training_scaling(stack))
    return folder
