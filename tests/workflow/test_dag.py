"""What a change makes run again: the set of rules in the resolved DAG."""

import subprocess

import pytest
import yaml

from raptor.moulds.library import TISSUES
from tests.small import ROOT
from tests.workflow.conftest import TINY
from tests.workflow.test_end_to_end import variant

EVERYTHING = {
    "all", "record_configuration", "compile_kernels", "sample_design", "simulate_shard", "build_stack",
    "augment_dataset", "check_dataset", "write_card", "train_member", "assemble_model",
    "design_further", "enrich", "simulate_further", "stack_further", "measure_floor", "evaluate_model",
    "evaluate_baseline", "compare_models", "summarise_evaluation", "plot_calibration", "plot_regions",
    "plot_worst", "plot_models", "plot_enrichment", "ship",
    "fit_tissue", "fit_by_simulator", "infer_parameters", "fit_joint", "fit_outline", "simulate_unmeasured",
    "plot_valley", "tabulate_fits", "measure_tradeoff", "plot_design", "plot_fields", "plot_bulk",
    "plot_training", "plot_fit", "plot_tradeoff", "tabulate_tradeoff", "plot_folding", "report",
    "design_sweep", "simulate_sweep", "measure_sweep", "predict_sweep", "compare_sweep", "plot_contraction",
    "plot_panels", "plot_directors", "write_report",
}  # fmt: skip


@pytest.fixture
def place(finished):
    assert finished.result.returncode == 0, finished.result.stderr[-3000:]
    return finished


def test_an_empty_folder_needs_everything(workplace):
    assert workplace("empty").jobs() == EVERYTHING


def test_a_second_run_has_nothing_to_do(place):
    assert place.jobs() == set()
    assert "Nothing to be done" in place.run("--cores", "1").stderr


def test_a_lost_report_is_written_again(place):
    folder = place.folder / "results" / "tiny"
    for name, jobs in (("workflow.html", set()), ("report.html", {"write_report"})):
        (folder / name).unlink()
        assert place.jobs() == jobs | {"report", "all"}
        assert place.run("--cores", "1").returncode == 0
        assert (folder / name).stat().st_size > 10**5


def test_another_target_of_the_fit_runs_no_simulation(place, tmp_path):
    tissues = yaml.safe_load(TISSUES.read_text())
    tissues["glial_1"]["area_ratio"] = 0.7
    path = tmp_path / "tissues.yaml"
    path.write_text(yaml.safe_dump(tissues))
    jobs = place.jobs(configuration=variant(tmp_path, fit__tissues_file=str(path)))
    assert jobs == {
        "record_configuration", "fit_tissue", "fit_by_simulator", "infer_parameters", "fit_joint",
        "fit_outline", "tabulate_fits", "plot_fit", "plot_valley", "write_report", "report", "all",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("change", "not_again"),
    [
        (
            {"surrogate__epochs": 3},
            {"sample_design", "simulate_shard", "build_stack", "check_dataset"},
        ),
        ({"fields__pixels": 64}, {"sample_design", "simulate_shard"}),
        ({"sweep__seeds": 2}, {"simulate_shard", "train_member", "fit_tissue", "measure_tradeoff"}),
        ({"tradeoff__seeds": 5}, {"simulate_shard", "train_member", "fit_tissue", "plot_fit"}),
        ({"fit__error": 0.02}, {"simulate_shard", "train_member", "fit_tissue", "fit_by_simulator"}),
        ({"fit__simulations": 6}, {"train_member", "fit_tissue", "infer_parameters", "fit_outline"}),
        ({"simulation__accuracy": "standard"}, {"sample_design", "compile_kernels", "plot_design"}),
        ({"seed": 1}, {"compile_kernels"}),
    ],
    ids=lambda value: str(next(iter(value))) if isinstance(value, dict) else "",
)
def test_a_change_runs_what_hangs_on_it_and_no_more(place, tmp_path, change, not_again):
    jobs = place.jobs(configuration=variant(tmp_path, **change))
    assert jobs
    assert not jobs & not_again


def test_targets_make_their_part(workplace):
    place = workplace("targets")
    assert "train_member" not in place.jobs("dataset")
    assert "evaluate_model" not in place.jobs("train")
    assert {"evaluate_model", "train_member"} <= place.jobs("evaluate")
    assert {"simulate_sweep", "plot_contraction", "plot_panels", "plot_directors"} <= place.jobs("sweep")
    fits = {"fit_tissue", "fit_by_simulator", "infer_parameters", "fit_joint", "fit_outline", "plot_valley"}
    assert fits <= place.jobs("fit")
    assert {"measure_tradeoff", "plot_tradeoff"} <= place.jobs("tradeoff")
    assert {"plot_fields", "plot_bulk"} <= place.jobs("figures")
    assert place.jobs("report") == EVERYTHING - {"all"}


def test_parts_that_are_not_asked_for_are_left_out(workplace, tmp_path):
    jobs = workplace("no_sweep").jobs(configuration=variant(tmp_path, sweep__moulds=[]))
    assert {name for name in EVERYTHING - jobs if "sweep" in name} == {n for n in EVERYTHING if "sweep" in n}
    assert "write_report" in jobs


def test_a_gpu_s_profile_asks_for_it_where_it_is_used(workplace):
    place = workplace("gpu")
    profile = str(ROOT / "workflow" / "profiles" / "gpu")
    done = place.run("--dry-run", "--cores", "4", "--workflow-profile", profile, "dataset")
    assert done.returncode == 0, done.stderr
    shown = done.stdout + done.stderr
    assert shown.count("gpu=1") >= 4  # three shards and the stack
    laid_over = place.command("--dry-run", "dataset")
    laid_over.insert(laid_over.index(str(TINY)) + 1, str(ROOT / "config" / "gpu.yaml"))
    done = subprocess.run(laid_over, capture_output=True, text=True, check=False, cwd=place.folder)
    assert done.returncode == 0, done.stderr
    assert "00000-00007.nc" in done.stdout + done.stderr  # one shard for the GPU
