"""What a change makes run again: the set of rules in the resolved DAG."""

import pytest
import yaml

from raptor.moulds.library import TISSUES
from tests.small import ROOT
from tests.workflow.place import PROFILES, TINY, variant

PAPER = "results/tiny/campaigns/paper/fields.nc"

CHAIN = {
    "compile_kernels", "design_campaign", "simulate_shard", "build_stack", "list_examples", "check_campaign",
    "write_card", "tabulate_campaign", "check_splits",
}  # fmt: skip
"""What makes every campaign, whatever its kind."""
TRAINING = {"fit_scaling", "train_member", "assemble_model"}
EVALUATION = {
    "measure_floor", "evaluate_model", "summarise_evaluation", "compare_models", "predict_samples",
    "ship_model",
}  # fmt: skip
SWEEPS = {"predict_campaign", "compare_contraction"}
TRADEOFF = {"measure_tradeoff", "tabulate_tradeoff", "plot_folding"}
FITS = {"fit_tissue", "fit_by_simulator", "infer_parameters", "fit_outline", "tabulate_fits"}
REPORT = {"record_configuration", "write_report", "report", "all"}
EVERYTHING = (
    CHAIN | TRAINING | EVALUATION | SWEEPS | TRADEOFF | FITS | REPORT
    | {"plot_tables", "plot_fields", "search_moulds"}
)  # fmt: skip


def test_an_empty_folder_needs_everything(workplace):
    assert workplace("empty").jobs() == EVERYTHING


def test_a_second_run_has_nothing_to_do(place):
    assert place.jobs() == set()
    assert "Nothing to be done" in place.run("--cores", "1").stderr


def test_a_lost_report_is_written_again(place):
    lost = {"workflow.html": {"report", "all"}, "report.html": {"write_report", "report", "all"}}
    for name, jobs in lost.items():
        (place.results / name).unlink()
        assert place.jobs() == jobs
    assert place.run("--cores", "1").returncode == 0
    assert all((place.results / name).stat().st_size > 10**5 for name in lost)


def test_another_measurement_runs_no_campaign(place, tmp_path):
    tissues = yaml.safe_load(TISSUES.read_text())
    tissues["glial_1"]["area_ratio"] = 0.7
    path = tmp_path / "tissues.yaml"
    path.write_text(yaml.safe_dump(tissues))
    jobs = place.jobs(configuration=variant(tmp_path, fit__tissues_file=str(path)))
    assert jobs == FITS | REPORT | {"plot_fields", "plot_tables"}


@pytest.mark.parametrize(
    ("change", "not_again"),
    [
        (
            {"models__film_unet": {"base_channels": 4, "epochs": 3, "pixels": 16}},
            CHAIN
            - {
                "design_campaign",
                "simulate_shard",
                "build_stack",
                "list_examples",
                "check_campaign",
                "write_card",
                "check_splits",
                "tabulate_campaign",
            },
        ),
        ({"tradeoff__methods": ["draft"]}, CHAIN | TRAINING | FITS | SWEEPS),
        (
            {"fit__simulations": 6},
            CHAIN | TRAINING | SWEEPS | {"fit_tissue", "infer_parameters", "fit_outline"},
        ),
        ({"accuracy": "standard"}, {"compile_kernels"}),
        ({"seed": 1}, {"compile_kernels"}),
    ],
    ids=lambda value: str(next(iter(value))) if isinstance(value, dict) else "",
)
def test_a_change_runs_what_hangs_on_it_and_no_more(place, tmp_path, change, not_again):
    jobs = place.jobs(configuration=variant(tmp_path, **change))
    assert jobs
    assert not jobs & not_again


@pytest.mark.parametrize(
    ("change", "jobs"),
    [
        ({"pixels": 64}, CHAIN - {"compile_kernels", "design_campaign", "simulate_shard", "check_splits"}),
        ({"shard_size": 2}, CHAIN - {"compile_kernels", "design_campaign", "check_splits"}),
        ({"check_fraction": 0.5}, {"check_campaign"}),
        ({"models__pix2pix": {"epochs": 1}}, set()),
    ],
    ids=lambda value: str(next(iter(value))) if isinstance(value, dict) else "",
)
def test_a_change_makes_its_part_of_a_campaign_again(place, tmp_path, change, jobs):
    found = place.jobs("campaign_paper", configuration=variant(tmp_path, **change))
    assert found - {"campaign_paper"} == jobs


def test_a_further_campaign_leaves_the_others_alone(place, tmp_path):
    mine = {"moulds": "glial_1", "grid": {"delta": [0.5], "kappa_nnn": [0.5], "ratio": [0.5]}}
    jobs = place.jobs(configuration=variant(tmp_path, campaigns__mine=mine))
    assert jobs == (CHAIN - {"compile_kernels"}) | SWEEPS | REPORT | {"plot_fields", "plot_tables"}


@pytest.mark.parametrize(
    ("target", "needed", "not_needed"),
    [
        ("campaign_paper", CHAIN - {"check_splits"}, TRAINING | {"check_splits"}),
        ("results/tiny/studies/sweep/simulated.csv", {"tabulate_campaign"}, TRAINING),
        ("campaigns", CHAIN, EVALUATION | FITS),
        ("train", TRAINING, EVALUATION | FITS),
        ("evaluate", EVALUATION - {"predict_samples"}, FITS | SWEEPS),
        ("studies", SWEEPS | {"plot_tables", "plot_fields", "search_moulds"}, FITS | EVALUATION),
        ("fit", FITS, SWEEPS),
        ("tradeoff", TRADEOFF | {"plot_tables"}, FITS | SWEEPS),
        ("figures", {"predict_samples", "plot_tables", "plot_fields", "plot_folding"}, {"ship_model"}),
        ("report", EVERYTHING - {"all"}, set()),
    ],
    ids=lambda value: value.rpartition("/")[2] if isinstance(value, str) else "",
)
def test_a_target_makes_its_part(workplace, target, needed, not_needed):
    jobs = workplace("targets").jobs(target)
    assert needed <= jobs
    assert not not_needed & jobs


def test_parts_that_are_not_asked_for_are_left_out(workplace, tmp_path):
    content = yaml.safe_load(TINY.read_text())
    campaigns = {"paper": content["campaigns"]["paper"]}
    changes = {"campaigns": campaigns, "models": {}, "tradeoff": {"cases": {}}, "fit": {"joint": []}} | {
        "searches": {}
    }
    jobs = workplace("plain").jobs(configuration=variant(tmp_path, **changes))
    assert jobs == CHAIN | REPORT | {"plot_tables"}


def test_several_tissues_are_fitted_together_too(workplace, tmp_path):
    changes = {"fit__tissues": ["glial_1", "glial_3"], "fit__joint": ["glial_1", "glial_3"]}
    assert workplace("joint").jobs("fit", configuration=variant(tmp_path, **changes)) >= FITS | {"fit_joint"}


def test_a_gpu_s_profile_asks_for_it_where_it_is_used(workplace):
    place = workplace("gpu")
    done = place.run("--dry-run", "--cores", "4", "--workflow-profile", PROFILES / "gpu", PAPER)
    assert done.returncode == 0, done.stderr
    shown = done.stdout + done.stderr
    assert shown.count("gpu=1") >= 4  # three shards and the stack
    done = place.run(ROOT / "config" / "gpu.yaml", "--dry-run", PAPER)  # laid over the tiny one
    assert done.returncode == 0, done.stderr
    assert "00000-00007.nc" in done.stdout + done.stderr  # one shard for the GPU
