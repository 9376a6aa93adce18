"""The command line as a user meets it; but for two runs in this process, which need not start again."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import shapely
import xarray as xr

from raptor.cli import COMMANDS
from raptor.core.errors import RaptorError
from raptor.core.files import atomic_path
from raptor.dataset.check import check
from raptor.fields.labelled import mould_of
from raptor.moulds import Mould, read_mould, write_moulds
from raptor.moulds.cast import cast_sites
from raptor.moulds.library import MOULDS
from tests.commands import options, raptor
from tests.small import ROOT
from tests.stand_ins import untrained

MOULD = str(MOULDS["tenocyte"])
DOG_BONE = ROOT / "tests" / "data" / "moulds"


def test_simulate_as_a_program_writes_fields_and_cells(tmp_path):
    output = tmp_path / "tissue.nc"
    program = Path(sys.executable).parent / "raptor"
    arguments = ("simulate", MOULD, *options(), "--layers", 1, "--accuracy", "draft", "--output", output)
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "converged" in done.stdout
    assert check(output) == []
    with xr.open_dataset(output, group="cells") as cells, xr.open_dataset(output) as fields:
        assert int(cells["row_size"][0]) == cells.sizes["cell"] > 500
        assert float(fields.density.sum()) == pytest.approx(cells.sizes["cell"], rel=1e-4)
        assert mould_of(fields).outline.equals(read_mould(MOULD).outline)


def test_simulate_takes_a_tissue_and_gives_a_picture_and_numbers(tmp_path):
    output, picture = tmp_path / "tissue.nc", tmp_path / "tissue.png"
    done = raptor(
        "simulate", DOG_BONE / "dog_bone.svg", "--tissue", "corneal", "--delta", 0.3, "--scale", 0.5,
        "--layers", 1, "--accuracy", "draft", "--output", output, "--picture", picture, "--json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    numbers = json.loads(done.stdout)
    assert (numbers["delta"], numbers["kappa_nnn"]) == (0.3, 0.6465)  # a flag goes before the tissue
    assert check(output) == []
    with xr.open_dataset(output, group="cells") as cells:
        assert numbers["cells"] == cells.sizes["cell"]
        assert numbers["converged"] is bool(cells["converged"][0])
    assert 0.3 < numbers["width_ratio"] < 1
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_draw_shows_converts_and_compares(tmp_path):
    picture, converted = tmp_path / "a.svg", tmp_path / "a.geojson"
    files = ("--output", picture, "--geojson", converted)
    done = raptor("draw", DOG_BONE / "dog_bone.svg", *files)
    assert done.returncode == 0, done.stderr
    assert "size 52 x 24 l0" in done.stdout
    assert "<svg" in picture.read_text()
    done = raptor("draw", DOG_BONE / "dog_bone.geojson", "--like", converted, "--json", "--layers", 3)
    numbers = json.loads(done.stdout)
    assert (numbers["width"], numbers["height"], numbers["tethers"]) == (52, 24, 4)
    assert numbers["symmetry"] == "mirrors"
    assert numbers["cells"] == numbers["like_cells"] == len(cast_sites(read_mould(converted), 3))
    assert numbers["like_difference"] < 1e-9


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--output", "a.jpg"), "a.jpg is not a picture's name; give one that ends in .png or .svg"),
        (("--output", "nowhere/a.png"), "folder nowhere does not exist"),
        (("--geojson", "a.svg"), "a.svg is not a GeoJSON file name"),
        (("--layers", 0), "layers is 0; 1 to 64 are allowed"),
        (("--scale", 0), "scale is 0.0; give a positive number"),
        (("--scale", 0.1), "tether <circle> at (-21, -7) is too thin"),
        (("--like", "none.png"), "none.png does not exist"),
    ],
)
def test_bad_input_to_draw(arguments, message):
    done = raptor("draw", DOG_BONE / "dog_bone.svg", *arguments)
    assert done.returncode == 1
    assert done.stderr.startswith("error: ")
    assert message in done.stderr


def test_masks_are_written_and_read_as_a_mould_again(tmp_path):
    masks, picture, drawn = tmp_path / "m.nc", tmp_path / "m.png", DOG_BONE / "dog_bone.geojson"
    for output in (masks, picture):
        done = raptor("rasterise", drawn, "--pixels", 512, "--output", output)
        assert done.returncode == 0, done.stderr
    mould, again = read_mould(drawn), read_mould(picture)
    assert len(again.tethers) == 4
    assert again.outline.symmetric_difference(mould.outline).area < 0.02 * mould.outline.area
    with xr.open_dataset(masks) as found:
        area = float(found["depression"].sum()) * (62.5 / 512) ** 2
        assert area == pytest.approx(mould.depression.area, rel=0.01)
        assert not (found["depression"] & found["tethers"]).any()
        assert mould_of(found).outline.equals(mould.outline)
    assert "m.jpg is no name for masks" in raptor("rasterise", drawn, "--output", "m.jpg").stderr
    done = raptor("plot", masks, "--output", tmp_path / "p.png")
    assert "does not hold the fields of one tissue" in done.stderr


def test_the_library_is_listed():
    lines = raptor("moulds").stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(MOULDS)
    assert any("glial_1 53 x 26.5 l0 4 tethers" in " ".join(line.split()) for line in lines)
    lines = raptor("tissues").stdout.splitlines()
    assert "glial_1       mould glial_1       A/A0 0.814, w/w0 0.797  Glial cells, G1" in lines[0]
    assert "not measured" in lines[-1]


def test_every_command_teaches_by_an_example():
    for command in COMMANDS:
        assert re.search(rf"\n    Example:\n      raptor {command.__name__}\b", command.__doc__)
    done = raptor("simulate", "--help")
    assert "raptor simulate mould.svg --tissue glial_1 \\" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((MOULD,), "give --delta, --kappa-nnn, --kappa-nnnn, or --tissue NAME"),
        ((MOULD, "--tissue", "glia_1"), "did you mean 'glial_1'?"),
        (
            (MOULD, "--tissue", "glial_1", "--tissues", "none.yaml"),
            "none.yaml cannot be read",
        ),
        ((MOULD, *options(), "--picture", "a.gif"), "a.gif is not a picture's name"),
        (("none.geojson", *options()), "none.geojson does not exist"),
        ((MOULD, *options(delta=1.0)), "delta is 1.0; the model allows 0 <= delta < 1"),
        ((MOULD, *options(nnn=-1)), "kappa_nnn is -1.0; the model allows 0 <= kappa_nnn <= 1"),
        ((MOULD, *options(), "--layers", 0), "layers is 0; 1 to 64 are allowed"),
        ((MOULD, *options(), "--accuracy", "best"), "allowed are draft, standard, reference"),
        ((MOULD, *options(), "--output", "nowhere/x.nc"), "folder nowhere does not exist"),
    ],
)
def test_bad_input_to_simulate(arguments, message, tmp_path):
    if "--output" not in arguments:
        arguments = (*arguments, "--output", tmp_path / "x.nc")
    done = raptor("simulate", *arguments)
    assert done.returncode != 0
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_mould_without_cells(tmp_path):
    path = tmp_path / "tiny.geojson"
    ring = [[0.1, 0.1], [9.4, 0.1], [9.4, 0.4], [0.1, 0.4]]  # between two rows of sites
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    done = raptor("simulate", path, *options(), "--output", tmp_path / "x.nc")
    assert done.returncode != 0
    assert "holds no cell" in done.stderr


def test_bad_input_to_predict_and_check(tmp_path):
    done = raptor("predict", MOULD, *options(nnn=0.2), "--model", tmp_path, "--output", tmp_path / "x.nc")
    assert done.returncode != 0
    assert "above kappa_nnn/sqrt(2)" in done.stderr
    done = raptor("predict", MOULD, *options(), "--model", tmp_path, "--output", tmp_path / "x.nc")
    assert "model.json cannot be read" in done.stderr
    done = raptor("check", tmp_path / "none")
    assert done.returncode != 0
    assert "does not exist" in done.stderr


def test_no_result_takes_the_place_of_an_input(tmp_path):
    mould = tmp_path / "mine.png"
    before = (DOG_BONE / "dog_bone.png").read_bytes()
    mould.write_bytes(before)
    for command, more in (
        ("simulate", ("--output", mould)),
        ("predict", ("--output", tmp_path / "x.nc", "--picture", mould)),
        ("draw", ("--output", mould)),
    ):
        parameters = () if command == "draw" else options()[:6]
        done = raptor(command, mould, *parameters, *more)
        assert done.returncode == 1
        assert "another file of this command" in done.stderr
        assert mould.read_bytes() == before


def test_check_and_same(made, tmp_path):
    done = raptor("check", made)
    assert (done.returncode, done.stdout.strip()) == (0, f"{made}: no faults")
    empty = tmp_path / "empty.geojson"
    write_moulds(empty, [Mould(shapely.box(0.1, 0.1, 9.4, 0.4))])
    done = raptor("check", empty)
    assert done.returncode == 1
    assert "holds no cell" in done.stdout
    done = raptor("same", made, made)
    assert (done.returncode, done.stdout.strip()) == (0, "the same data")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
def test_a_full_disk_is_named_and_leaves_what_was_there(tmp_path):
    path = tmp_path / "file.txt"
    path.write_text("before")
    with (
        pytest.raises(RaptorError, match="no room left on the disk"),
        atomic_path(path) as temporary,
    ):
        temporary.write_text("half")
        with Path("/dev/full").open("w") as full:
            full.write("x" * 10**6)
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_a_failed_writer_leaves_what_was_there(tmp_path):
    path = tmp_path / "file.txt"
    path.write_text("before")
    with pytest.raises(RuntimeError), atomic_path(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_predict_writes_fields_that_check_takes(tmp_path):
    untrained(tmp_path, calibrated=False)
    output = tmp_path / "prediction.nc"
    done = raptor("predict", MOULD, *options(), "--model", tmp_path, "--output", output)
    assert done.returncode == 1
    assert "not calibrated" in done.stderr
    untrained(tmp_path)
    done = raptor("predict", MOULD, *options(), "--model", tmp_path, "--output", output)
    assert done.returncode == 0, done.stderr
    assert "A/A0" in done.stdout
    assert "unusual: " in done.stdout
    with xr.open_dataset(output) as prediction:
        assert prediction["density"].dims == ("y", "x")
        assert (prediction["density_std"] > 0).all()
        assert float(prediction["delta"]) == 0.5
        assert float(prediction["area_ratio_band"].sel(level=0.95)) >= 0.3
    assert raptor("check", output).returncode == 0


def test_the_shipped_model_predicts_without_training(tmp_path):
    from raptor.surrogate.rules import SHIPPED

    size = sum(path.stat().st_size for path in SHIPPED.iterdir())
    assert size < 20e6
    output, picture = tmp_path / "prediction.nc", tmp_path / "prediction.png"
    done = raptor(
        "predict", "four_post_rectangle", *options(), "--output", output, "--picture", picture, "--json"
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert 0 < found["width_ratio"] < 1
    assert 0 < found["area_ratio"] < 1
    assert found["area_ratio_band95"] > 0
    assert picture.stat().st_size > 10_000
    with xr.open_dataset(output) as prediction:
        assert dict(prediction.sizes)["x"] == 256
    assert raptor("check", output).returncode == 0


def test_check_takes_moulds_and_tables(made, tmp_path):
    for path in (MOULD, made / "design.csv", made / "examples.csv"):
        assert check(Path(path)) == []
    for name in ("dog_bone.svg", "dog_bone.png"):
        assert check(DOG_BONE / name) == []
    bad = tmp_path / "bad.geojson"
    bad.write_text('{"type": "FeatureCollection", "features": [1]}')
    done = raptor("check", bad)
    assert done.returncode == 1
    assert "holds no mould" in done.stdout


def test_a_full_disk_stops_a_simulation_with_one_sentence(tmp_path):
    """A file-size limit stands in for the full disk: HDF5 reports both in its own way."""
    script = (
        "import resource, signal, sys; signal.signal(signal.SIGXFSZ, signal.SIG_IGN);"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096));"
        "import raptor.core.files as f; f._is_full = lambda folder: True;"
        "from raptor.cli import main; main()"
    )
    output = tmp_path / "x.nc"
    arguments = ["simulate", MOULD, *options(), "--layers", 2, "--accuracy", "draft", "--output", output]
    done = subprocess.run(
        [sys.executable, "-c", script, *map(str, arguments)], capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert done.stderr.startswith("error: no room left on the disk")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("text", ["0.1:x", "0.1:0.9", "0.1:0.9:1", "much"])
def test_a_range_that_cannot_be_read_is_named_before_any_work(tmp_path, text):
    done = raptor("sweep", "small_rectangle", "--delta", text, "--output", tmp_path / "curve.csv")
    assert done.returncode == 1
    assert f"--delta is '{text}'; give a number, or START:STOP:COUNT" in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_command_says_what_one_would_do_next_on_standard_error(tmp_path):
    done = raptor("draw", DOG_BONE / "dog_bone.svg", "--scale", 0.8)
    assert done.stderr.splitlines()[-1] == (
        f"next: raptor simulate {DOG_BONE / 'dog_bone.svg'} --scale 0.8 --tissue glial_1 --output tissue.nc"
    )
    assert "next" not in done.stdout
    done = raptor("draw", DOG_BONE / "dog_bone.svg", "--layers", 2)
    assert " --layers 2 --tissue" in done.stderr.splitlines()[-1]
    assert "next" not in raptor("draw", DOG_BONE / "dog_bone.svg", "--json").stderr
