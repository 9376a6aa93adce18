import json
import os
import shutil
import signal
import subprocess
import time

import netCDF4
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from safetensors.numpy import load_file

from raptor.core.jobs import hold_lock
from raptor.dataset.check import check
from raptor.dataset.compare import differences
from raptor.moulds import read_moulds
from raptor.symmetry import FIELDS
from tests.workflow.place import ENVIRONMENT, variant

CAMPAIGNS = {"paper", "replicates", "soft_corner", "active", "sweep"}


def test_the_run_ends_with_the_report(results):
    assert (results / "report.html").stat().st_size > 10**5
    text = (results / "workflow.html").read_text()
    for name in (
        "fields.png",
        "bulk.png",
        "training.png",
        "tradeoff.png",
        "design.png",
        "fit_glial_1.png",
        "contraction_sweep.png",
        "panels_sweep_i_shape.png",
        "directors_sweep.png",
        "valley_glial_1.png",
    ):
        assert name in text
    for name in ("card.md", "fits.csv", "regions.csv", "configuration.yaml", "summary.csv"):
        assert name in text


def test_the_campaigns_are_sound_and_open_with_xarray(results):
    assert check(results) == []
    with xr.open_dataset(results / "campaigns" / "paper" / "fields.nc") as stack:
        assert dict(stack.sizes) == {"sample": 8, "field": 8, "y": 32, "x": 32}
        assert [str(f) for f in stack["field"].values] == list(FIELDS)
        assert float(stack["fields"].sel(field="density").sum()) == pytest.approx(
            int(stack["n_cells"].sum()), rel=1e-4
        )
    assert {path.name for path in (results / "campaigns").iterdir() if path.is_dir()} == CAMPAIGNS
    for name in CAMPAIGNS:
        made = {path.name for path in (results / "campaigns" / name).iterdir()}
        assert made == {
            "design.csv", "moulds.geojson", "shards", "fields.nc", "examples.csv", "card.md", "checked.txt",
        }  # fmt: skip


def test_a_search_finds_moulds_and_simulates_them(results):
    folder = results / "searches" / "aligned"
    table = pd.read_csv(folder / "designs.csv")
    assert set(table["group"]) == {"searched"}
    assert table[["predicted_alignment", "simulated_alignment"]].abs().le(1).all(axis=None)
    moulds = read_moulds(folder / "designs.geojson")
    assert [mould.name for mould in moulds] == table["design"].tolist()
    assert {path.name for path in folder.glob("moulds/d01.*")} == {"d01.geojson", "d01.svg", "d01.dxf"}


def test_every_file_says_what_it_is(results):
    for path in [
        *results.glob("campaigns/*/shards/*.nc"),
        *results.glob("campaigns/*/fields.nc"),
        *results.glob("studies/*/predicted.nc"),
        results / "fits" / "glial_1.nc",
    ]:
        with netCDF4.Dataset(path) as file:
            for name in (
                "Conventions",
                "title",
                "source",
                "history",
                "references",
                "configuration",
                "license",
            ):
                assert getattr(file, name), (path, name)
            for variable in file.variables.values():
                assert variable.long_name, (path, variable.name)
                assert variable.units, (path, variable.name)


def test_surrogate_evaluation_fit_and_tradeoff_are_there(results):
    weights = load_file(results / "surrogate" / "film_unet" / "weights.safetensors")
    assert all(np.isfinite(value).all() for value in weights.values())
    assert {name.split(".")[0] for name in weights} == {"0", "1", "training_descriptors"}
    history = pd.read_csv(results / "surrogate" / "film_unet" / "training.csv")
    assert history[["member", "epoch"]].values.tolist() == [[0, 0], [0, 1], [1, 0], [1, 1]]
    assert {"generator_loss", "discriminator_loss", "validation_error"} <= set(history.columns)
    active = pd.read_csv(results / "surrogate" / "active" / "training.csv")
    assert active["epoch"].tolist() == [0, 1, 2]
    assert active["reconstruction_loss"].tolist()[:2] == history["reconstruction_loss"].tolist()[:2]
    selected = pd.read_csv(results / "campaigns" / "active" / "design.csv")
    assert selected["split"].tolist() == ["train", "train"]
    assert (selected["disagreement"] > 0).all()
    metrics = json.loads((results / "evaluation" / "film_unet" / "metrics.json").read_text())
    assert set(metrics) == {"paper", "soft_corner"}
    assert metrics["paper"]["samples"] == 2
    assert set(metrics["paper"]["bulk"]) == {
        "P", "N", "T", "Tbar", "SxSx", "SxSxbar", "SySy", "SySybar", "area_ratio", "width_ratio",
        "alignment", "anisotropy",
    }  # fmt: skip
    assert all(0 <= share <= 1 for share in metrics["paper"]["coverage"].values())
    with xr.open_dataset(results / "evaluation" / "samples.nc") as samples:
        simulated, again = samples["simulated"][:, 0], samples["again"]
        assert again.sizes["seed"] == 3
        cells, cells_again = simulated.sum(("y", "x")), again.sum(("y", "x"))
        assert (abs(cells_again / cells - 1) < 1e-3).all()
        assert (abs(again - simulated).max(("y", "x")) > 0).all()  # other seeds, other tissues
    floor = pd.read_csv(results / "evaluation" / "floors" / "paper.csv")
    assert floor["runs"].tolist() == [3]
    assert (floor["vrmse_density"] > 0).all()
    models = pd.read_csv(results / "evaluation" / "models.csv").set_index("model")
    assert models.index.tolist() == ["film_unet", "pix2pix", "active", "nearest", "mean"]
    assert (models.loc[["film_unet", "pix2pix"], "training_core_minutes"] > 0).all()
    assert models["density_in_floors"].notna().all()
    regions = pd.read_csv(results / "evaluation" / "film_unet" / "regions.csv").set_index("region")
    assert regions.loc["all", "samples"] == 2
    assert regions.loc["soft_corner: all", "samples"] == 2
    card = (results / "shipped" / "card.md").read_text()
    assert "| density |" in card
    assert "soft_corner: all" in card
    shipped = load_file(results / "shipped" / "weights.safetensors")
    assert shipped.keys() == weights.keys()
    fit = json.loads((results / "fits" / "glial_1.json").read_text())
    assert fit["simulation"]["rss"] >= 0
    assert fit["simulation"]["runs"] == 4
    by_simulator = json.loads((results / "fits" / "glial_1_simulator.json").read_text())
    assert by_simulator["fit"]["evaluations"] <= 5
    posterior = json.loads((results / "fits" / "glial_1_posterior.json").read_text())
    for parameter in posterior["parameters"].values():
        assert parameter["quantiles"]["0.025"] <= parameter["mean"] <= parameter["quantiles"]["0.975"]
    assert len(pd.read_csv(results / "fits" / "glial_1_draws.csv")) == 8
    ranked = pd.read_csv(results / "fits" / "glial_1_experimental_design.csv")
    assert {"outline", "alignment", "tension", "thickness"} <= set(ranked["measurement"])
    outline = json.loads((results / "fits" / "glial_1_outline.json").read_text())
    assert outline["outline"]["distance"] >= 0
    table = pd.read_csv(results / "fits" / "fits.csv").set_index("tissue")
    assert (table[["surrogate_again_rss", "corrected_again_rss", "simulator_again_rss"]] >= 0).all(axis=None)
    tradeoff = pd.read_csv(results / "tradeoff" / "tradeoff.csv")
    others = ["draft", "anneal-20", "1 layers", "shells 1 2 4", "16 pixels", "surrogate"]
    assert tradeoff["method"].tolist() == [f"reference, seed {n}" for n in range(1, 5)] + others
    assert (tradeoff["core_seconds"] > 0).all()
    assert tradeoff["density_error"].notna().all()
    summary = pd.read_csv(results / "tradeoff" / "summary.csv").set_index("method")
    assert summary.index.tolist() == ["reference", *others]
    assert summary.loc["anneal-20", "energy_above_best"] > summary.loc["reference", "energy_above_best"]


def test_sweeps_are_simulated_and_predicted_at_every_point(results):
    table = pd.read_csv(results / "studies" / "sweep" / "contraction.csv")
    assert len(table) == 2 * 2 * 4  # moulds, measures, points
    assert set(table["mould"]) == {"four_post_rectangle", "i_shape"}
    assert table[["simulated", "predicted", "band95"]].notna().all().all()
    assert ((table["delta"] == 0.9) & (table["kappa_nnn"] == 0.1) & (table["ratio"] == 0.1)).any()
    weak, strong = (table[table["delta"] == delta]["simulated"].mean() for delta in (0.2, 0.9))
    assert strong > weak
    found = json.loads((results / "studies" / "sweep" / "differences.json").read_text())
    assert [(entry["mould"], entry["measure"]) for entry in found] == list(
        dict.fromkeys(zip(table["mould"], table["measure"], strict=True))
    )
    largest = table.groupby(["mould", "measure"])["difference"].apply(lambda part: part.abs().max())
    for entry in found:
        there = largest[entry["mould"], entry["measure"]]
        assert abs(entry["largest"]["difference"]) == pytest.approx(there)


def test_every_figure_has_its_data(results):
    for figure in (
        "design", "fields", "bulk", "training", "calibration", "regions", "worst", "models", "tradeoff",
        "folding", "fit_glial_1", "valley_glial_1", "active_learning", "contraction_sweep",
        "panels_sweep_four_post_rectangle", "panels_sweep_i_shape", "directors_sweep",
    ):  # fmt: skip
        made = {path.suffix for path in (results / "figures").glob(f"{figure}.*")}
        assert {".png", ".svg"} <= made
        assert made & {".csv", ".nc"}


def test_killed_twice_and_in_other_shards_on_one_core_the_data_are_the_same(results, workplace, tmp_path):
    """SIGKILL to everything, among simulations and in training; the weights are the same too."""
    place, configuration = workplace("killed"), variant(tmp_path, shard_size=2)
    target = "results/tiny/surrogate/film_unet/weights.safetensors"
    for seen in ("campaigns/paper/shards/00000-00001.nc", "surrogate/film_unet/members/0/checkpoint.pt"):
        run = subprocess.Popen(
            place.command("--cores", "2", target, configuration=configuration),
            cwd=place.folder, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip
        deadline = time.monotonic() + 300
        while not (place.results / seen).exists():
            assert time.monotonic() < deadline, f"{seen} never appeared"
            assert run.poll() is None, f"the run ended before {seen} appeared"
            time.sleep(0.005)
        os.killpg(run.pid, signal.SIGKILL)
        run.wait()
    done = place.run("--cores", "1", target, configuration=configuration)
    assert done.returncode == 0, done.stderr[-2000:]
    folders = results, place.results
    assert differences(*(folder / "campaigns" / "paper" for folder in folders)) == []
    weights = [load_file(folder / "surrogate" / "film_unet" / "weights.safetensors") for folder in folders]
    assert all(np.array_equal(weights[0][name], weights[1][name]) for name in weights[0])


def test_a_truncated_shard_stops_the_run_with_one_sentence(place, workplace):
    other = workplace("truncated")
    for name in ("results", ".snakemake"):
        shutil.copytree(place.folder / name, other.folder / name)
    before, paper = (each.results / "campaigns" / "paper" for each in (place, other))
    target = "results/tiny/campaigns/paper/fields.nc"
    shard = next((paper / "shards").glob("*.nc"))
    shard.write_bytes(shard.read_bytes()[:2000])
    done = other.run("--cores", "1", target)
    assert done.returncode != 0
    assert f"{shard.name} is truncated or damaged" in done.stderr + done.stdout
    shard.unlink()
    done = other.run("--cores", "2", target)
    assert done.returncode == 0
    assert differences(before, paper) == []


def test_a_second_run_at_once_is_refused_and_touches_nothing(workplace):
    place = workplace("twice")
    hold_lock(place.folder / ".snakemake" / "tiny.lock", "results/tiny")
    done = place.run("--cores", "1", "results/tiny/configuration.yaml")
    assert done.returncode != 0
    assert f"results/tiny is being made by process {os.getpid()} on" in done.stderr + done.stdout
    assert "Traceback" not in done.stderr
    assert not (place.folder / "results").exists()
