"""The small data set that is kept with the code, and what tells, loads and measures data sets."""

import re

import numpy as np
import pytest
import yaml

from raptor.condor.simulate import simulate
from raptor.core.errors import RaptorError
from raptor.dataset.check import check
from raptor.dataset.design import read_design
from raptor.dataset.examples import read_examples, training_scaling
from raptor.dataset.provenance import trace_example, trace_simulation
from raptor.dataset.stack import read_samples
from raptor.fields.metrics import vrmse
from raptor.moulds import moulds_by_id
from raptor.parameters import CellParameters, NetworkModel
from raptor.raster import rasterise
from raptor.surrogate.batches import ExampleSet
from raptor.symmetry import Element, apply
from tests.commands import executed, module, python_blocks, raptor
from tests.small import CAMPAIGN, MINI, ROOT


def test_it_is_sound_and_small():
    assert check(MINI) == []
    assert sum(path.stat().st_size for path in MINI.rglob("*")) < 3e6


def test_a_trace_is_enough_to_make_the_fields_again():
    """From what the trace says alone: as near as two seeds are, for another processor rounds otherwise."""
    traced = trace_simulation(CAMPAIGN, 5)
    made_by, (sample,) = traced["made by"], read_samples(CAMPAIGN / "fields.nc", [5])
    assert (traced["fields"]["sample"], sample.simulation) == (5, 5)
    mould = moulds_by_id(CAMPAIGN / traced["mould"]["file"], {traced["mould"]["id"]})[traced["mould"]["id"]]
    model = NetworkModel(made_by["layers"], tuple(made_by["shells"]), made_by["tension"])
    parameters = CellParameters(**traced["parameters"])
    errors = []
    for seed in (traced["seed"], *range(4)):
        tissue = simulate(mould, parameters, model, made_by["accuracy"], seed)
        assert tissue.cells == sample.n_cells
        fields = rasterise(tissue.positions, tissue.orientation, tissue.tension, 64)
        errors.append(vrmse(fields[0], sample.fields[0]))
    assert errors[0] < 2 * np.mean(errors[1:])


def test_an_example_is_traced_to_its_image_and_simulation():
    chosen = read_examples(CAMPAIGN / "examples.csv")[7]
    traced = trace_example(CAMPAIGN, 7)
    assert traced["image under D4"]["element"] == chosen.element
    assert traced["fields"]["sample"] == chosen.sample
    assert "test" not in {trace_example(CAMPAIGN, n)["split"] for n in (0, 20, 40)}


def test_what_is_not_there_cannot_be_traced():
    with pytest.raises(RaptorError, match="has simulations 0 to 23, not 24"):
        trace_simulation(CAMPAIGN, 24)
    count = len(read_examples(CAMPAIGN / "examples.csv"))
    with pytest.raises(RaptorError, match=f"has examples 0 to {count - 1}; example {count} is not there"):
        trace_example(CAMPAIGN, count)


def test_the_command_line_traces():
    done = raptor("trace", CAMPAIGN, "--simulation", 3)
    assert yaml.safe_load(done.stdout) == trace_simulation(CAMPAIGN, 3)
    done = raptor("trace", CAMPAIGN)
    assert done.returncode == 1
    assert "give one of --simulation and --example" in done.stderr


def test_the_stack_states_seeds_and_model():
    seeds = {run.simulation: run.seed for run in read_design(CAMPAIGN / "design.csv")}
    samples = read_samples(CAMPAIGN / "fields.nc", range(24))
    assert {sample.simulation: sample.seed for sample in samples} == seeds


@pytest.fixture
def examples():
    chosen = read_examples(CAMPAIGN / "examples.csv")[:12]
    stack = CAMPAIGN / "fields.nc"
    return ExampleSet(stack, chosen, moulds_by_id(CAMPAIGN / "moulds.geojson"), training_scaling(stack))


def test_an_example_is_its_sample_moved_and_scaled(examples):
    for number in (0, 5, 11):
        example = examples.examples[number]
        (sample,) = read_samples(examples.stacks[0], [example.sample])
        moved = apply(sample.fields, Element.from_index(example.element))
        found = examples.scaling.inverse(examples[number][1].numpy())
        assert np.abs(found - moved).max() < 1e-5 * np.abs(moved).max()


def test_the_tutorial_runs(monkeypatch):
    monkeypatch.chdir(ROOT)
    printed = executed("\n".join(python_blocks(ROOT / "docs" / "tutorial.md")))
    count = len(read_examples(CAMPAIGN / "examples.csv"))
    assert f"{count} examples; inputs (6, 64, 64), targets (8, 64, 64)" in printed


def test_the_benchmark_of_places_on_the_lattice_prints_both_differences():
    seeds, places = module("benchmarks.lattice_phase", CAMPAIGN, "--count", 1).splitlines()
    assert re.fullmatch(r"seeds: density 0\.\d+, A/A0 0\.\d+, w/w0 (0\.\d+|nan), 1 moulds", seeds)
    assert places.startswith("places: density 0.")


def test_the_storage_benchmark_prints_its_tables():
    printed = module("benchmarks.storage", CAMPAIGN, "--samples", 8, "--channels", 2)
    for text in ("zstd 9", "zlib 1, 15 bits", "reading examples", "training, 2 base channels"):
        assert text in printed
