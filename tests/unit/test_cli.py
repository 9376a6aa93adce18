"""The command line as a user meets it: in a process of its own."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr

from raptor.dataset.checks import check
from raptor.errors import RaptorError
from raptor.files import atomic_path

ROOT = Path(__file__).parents[2]
MOULD = str(ROOT / "config" / "moulds" / "tenocyte.geojson")


def raptor(*arguments):
    command = [str(Path(sys.executable).parent / "raptor"), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def options(delta=0.5, nnn=0.5, nnnn=0.3):
    return ("--delta", delta, "--kappa-nnn", nnn, "--kappa-nnnn", nnnn)


def test_simulate_writes_a_sound_shard(tmp_path):
    output = tmp_path / "tissue.nc"
    done = raptor("simulate", MOULD, *options(), "--layers", 1, "--accuracy", "draft", "--output", output)
    assert done.returncode == 0, done.stderr
    assert "converged" in done.stdout
    assert check(output) == []
    with xr.open_dataset(output) as shard:
        assert int(shard["row_size"][0]) == shard.sizes["cell"] > 500


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
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
    ring = [[0.1, 0.1], [0.3, 0.1], [0.3, 0.3]]
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


def test_check_and_same(made):
    done = raptor("check", made)
    assert (done.returncode, done.stdout.strip()) == (0, f"{made}: no faults")
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
