"""raptor fit as a user meets it."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from raptor.moulds import read_mould
from raptor.moulds.library import MOULDS
from tests.commands import options, raptor
from tests.photograph import CASES
from tests.stand_ins import untrained

MOULD = str(MOULDS["tenocyte"])


def test_fit_by_a_surrogate_gives_intervals(tmp_path, quick_fits):
    output, picture = tmp_path / "fit.json", tmp_path / "fit.png"
    done = raptor(
        "fit", MOULD, "--tissue", "glial_1", "--model", untrained(tmp_path), "--by", "surrogate",
        "--output", output, "--picture", picture, "--json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    numbers, content = json.loads(done.stdout), json.loads(output.read_text())
    assert numbers["simulations"] == 0
    for name in ("delta", "kappa_nnn", "kappa_nnnn"):
        assert numbers[f"{name}_lower"] <= numbers[name] <= numbers[f"{name}_upper"]
    assert numbers["rss"] == pytest.approx(content["fit"]["rss"])
    assert content["target"] == {"area_ratio": 0.81404, "width_ratio": 0.7972}
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_fit_to_a_photograph_fits_what_measure_measures(tmp_path, quick_fits):
    case = next(each for each in CASES if each.mould == "tenocyte")
    _, _, grey = case.made()
    names = ("photo.png", "fit.json", "overlay.png", "picture.png")
    photo, output, overlay, picture = (tmp_path / name for name in names)
    Image.fromarray(grey).save(photo)
    options = ("--model", untrained(tmp_path), "--accuracy", "draft", "--output", output)
    done = raptor("fit", case.mould, "--photo", photo, "--overlay", overlay, "--picture", picture, *options)
    assert done.returncode == 0, done.stderr
    assert "l0 apart" in done.stdout
    assert 1 <= json.loads(output.read_text())["simulations"] <= 3
    assert picture.read_bytes().startswith(b"\x89PNG")
    measured = json.loads(raptor("measure", photo, "--mould", case.mould, "--json").stdout)
    target = json.loads(output.read_text())["target"]
    assert target == {name: measured[name] for name in ("area_ratio", "width_ratio")}
    assert overlay.read_bytes().startswith(b"\x89PNG")
    done = raptor("fit", case.mould, "--photo", photo, "--area-ratio", 0.5, *options)
    assert "give one kind of measurement" in done.stderr


@pytest.mark.parametrize("command", ["measure", "fit"])
def test_a_refused_photograph_still_writes_its_overlay(command, tmp_path):
    photo, overlay = tmp_path / "photo.png", tmp_path / "overlay.png"
    Image.fromarray(CASES[0].made()[2]).save(photo)
    files = {
        "measure": (photo, "--mould", MOULD),
        "fit": (MOULD, "--photo", photo, "--output", tmp_path / "x"),
    }
    done = raptor(command, *files[command], "--overlay", overlay)
    assert done.returncode == 1
    assert "does not have the shape of tenocyte" in done.stderr
    assert f"(see {overlay})" in done.stderr
    assert overlay.read_bytes().startswith(b"\x89PNG")
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize("what", ["ratios", "outline"])
def test_fit_by_the_simulator_from_parameters_of_ones_own(tmp_path, what):
    """The tissue that is fitted is one of the simulator's own, a little off the start."""
    from raptor.condor.simulate import simulate
    from raptor.fields.shape import shape_ratios
    from raptor.moulds.cast import CastMould
    from raptor.parameters import CellParameters, NetworkModel
    from raptor.raster import density_threshold, rasterise

    mould = read_mould(Path(MOULD))
    made = simulate(mould, CellParameters(0.35, 0.5, 0.3), NetworkModel(1), "draft", 3)
    density = rasterise(made.positions, made.orientation, made.tension, 256)[0]
    if what == "ratios":
        area, width = shape_ratios(density, CastMould(mould, 1, 256))
        target = ("--area-ratio", area, "--width-ratio", width)
    else:
        tissue = density < density_threshold(1, 256)
        Image.fromarray((255 * tissue[::-1]).astype(np.uint8)).save(tmp_path / "tissue.png")
        target = ("--outline", tmp_path / "tissue.png")
    output = tmp_path / "fit.json"
    done = raptor(
        "fit", MOULD, *target, "--by", "simulator", *options(delta=0.3), "--layers", 1, "--accuracy", "draft",
        "--simulations", 10, "--output", output,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(output.read_text())["fit"]
    assert found["evaluations"] <= 10
    assert found["parameters"]["delta"] == pytest.approx(0.35, abs=0.04)
    assert found["rss"] < (1e-3 if what == "ratios" else 0.3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "give one kind of measurement"),
        (("--tissue", "glial_1", "--area-ratio", 0.5), "give one kind of measurement"),
        (("--tissue", "tenocyte"), "has no measured ratio to fit"),
        (("--area-ratio", 2), "a ratio to the tissue as cast lies between 0 and 1.5"),
        (("--area-ratio", 0.5, *options()), "or --by simulator"),
        (("--area-ratio", 0.5, "--by", "simulator", *options(nnn=0.2)), "above kappa_nnn/sqrt(2)"),
        (("--area-ratio", 0.5, "--model", "nowhere"), "model.json cannot be read"),
        (("--outline", MOULD), "is a mould; give the tissue's, from raptor measure --outline"),
        (("--area-ratio", 0.5, "--picture", "a.gif"), "a.gif is not a picture's name"),
    ],
)
def test_bad_input_to_fit(arguments, message, tmp_path):
    done = raptor("fit", MOULD, *arguments, "--output", tmp_path / "x.json")
    assert done.returncode == 1
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())
