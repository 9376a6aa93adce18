"""Files as people have them: drawings, pictures and tables of many programs (tests/data/doors)."""

import os
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import tifffile
import yaml
from PIL import Image

import raptor
from raptor.cli import main
from raptor.cli.options import require_writable
from raptor.core.blocks import read_yaml
from raptor.core.errors import RaptorError
from raptor.core.files import read_input, read_json
from raptor.core.jobs import hold_lock
from raptor.core.pixels import TURNS, read_pixels
from raptor.dataset.design import read_design
from raptor.dataset.netcdf import create, open_file
from raptor.dataset.shards import read_shard
from raptor.imaging import measure, read_picture, register
from raptor.moulds import Circle, read_mould
from raptor.moulds.cast import cast_sites

pytestmark = pytest.mark.one_processor

DATA = Path(__file__).parents[1] / "data"
DOORS = DATA / "doors"
EXPECTED = yaml.safe_load((DOORS / "expected.yaml").read_text(encoding="utf-8"))
DOG_BONE = read_mould(DATA / "moulds" / "dog_bone.geojson")


@pytest.mark.parametrize("name", EXPECTED)
def test_every_drawing_holds_what_it_shows(name):
    expected = EXPECTED[name]
    if "says" in expected:
        with pytest.raises(RaptorError) as caught:
            read_mould(DOORS / name)
        assert expected["says"] in str(caught.value)
        assert str(caught.value).count("\n") == 0
        return
    mould = read_mould(DOORS / name)
    assert (mould.mm_per_l0 or 0) == pytest.approx(expected["mm"] or 0, rel=1e-4)
    if expected["mould"] == "square":
        assert mould.outline.bounds == (-31.25, -31.25, 31.25, 31.25)
        assert mould.tethers == ()
        return
    assert np.array_equal(cast_sites(mould, 7), cast_sites(DOG_BONE, 7))
    assert len(mould.tethers) == 4
    assert all(isinstance(tether, Circle) for tether in mould.tethers) == expected.get("round", True)


def test_a_table_with_a_mark_is_read_and_another_encoding_is_named():
    assert len(read_design(DOORS / "text" / "design_bom.csv")) == 24
    with pytest.raises(RaptorError, match=r"is not UTF-8 text: line 5 .*Latin-1"):
        raptor.tissue("glial_1", DOORS / "text" / "tissues_latin1.yaml")


def test_a_picture_is_read_as_it_is_shown():
    mould = read_mould("free_square")
    turned, upright = (
        read_picture(DOORS / "image" / f"q_square_{name}.png") for name in ("exif6", "upright")
    )
    assert np.array_equal(turned.values, upright.values)
    found = measure(upright, mould, register(upright, mould, is_aligned=True))
    assert 0 < found.area_ratio < 1


@pytest.mark.parametrize("turn", range(1, 9))
@pytest.mark.parametrize("suffix", ["png", "jpg", "tif"])
def test_every_orientation_is_turned_upright(turn, suffix, tmp_path):
    upright = np.zeros((40, 60), np.uint8)
    upright[:10, :10], upright[:10, -10:] = 255, 128
    back = next(k for k in range(1, 9) if np.array_equal(_turned(_turned(upright, k), turn), upright))
    path = tmp_path / f"turned.{suffix}"
    exif = Image.Exif()
    exif[0x0112] = turn
    Image.fromarray(np.ascontiguousarray(_turned(upright, back))).save(path, exif=exif)
    assert np.abs(read_pixels(path).colours[..., 0] * 255 - upright).mean() < 2


def _turned(picture, turn):
    return TURNS[turn](picture) if turn in TURNS else picture


@pytest.fixture
def photograph():
    rng = np.random.default_rng(0)
    return np.clip(np.hypot(*np.mgrid[-30:30, -40:40]) * 4 + rng.normal(0, 3, (60, 80)), 0, 255).astype(
        np.uint8
    )


@pytest.mark.parametrize("compression", ["lzw", "deflate", "packbits", "zstd", "jpeg", "jpegxl", "lerc"])
def test_compressed_tiff_is_as_its_uncompressed_twin(compression, photograph, tmp_path):
    tifffile.imwrite(tmp_path / "plain.tif", photograph)
    tifffile.imwrite(tmp_path / "packed.tif", photograph, compression=compression)
    plain, packed = (read_pixels(tmp_path / f"{name}.tif").colours for name in ("plain", "packed"))
    assert np.abs(plain - packed).max() < (0.1 if compression == "jpeg" else 1e-6)


def test_two_values_by_fax_are_a_mask():
    picture = read_picture(DOORS / "image" / "m_bit1.tif")
    assert picture.mask
    assert set(np.unique(picture.values)) == {0.0, 1.0}


def test_cmyk_and_grey_with_alpha_are_converted(photograph, tmp_path):
    grey = Image.fromarray(photograph)
    grey.convert("RGB").convert("CMYK").save(tmp_path / "cmyk.jpg", quality=98)
    grey.convert("RGB").convert("CMYK").save(tmp_path / "cmyk.tif")
    transparent = grey.convert("LA")
    transparent.putalpha(90)
    transparent.save(tmp_path / "la.png")
    transparent.save(tmp_path / "la.tif")
    for name in ("cmyk.jpg", "cmyk.tif", "la.png", "la.tif"):
        values = read_picture(tmp_path / name).values
        assert np.abs(values - photograph / photograph.max()).mean() < 0.02, name


@pytest.mark.parametrize("kind", ["imagej", "pages", "ome", "png", "gif"])
def test_a_stack_is_asked_for_its_page_and_never_blended(kind, photograph, tmp_path):
    stack = np.stack([photograph, photograph[::-1], photograph // 2])
    path = tmp_path / {"png": "stack.png", "gif": "stack.gif", "ome": "stack.ome.tif"}.get(kind, "stack.tif")
    if kind == "imagej":
        tifffile.imwrite(path, stack, imagej=True, metadata={"axes": "TYX"})
    elif kind == "ome":
        tifffile.imwrite(path, stack, metadata={"axes": "TYX"}, photometric="minisblack")
    elif kind == "pages":
        with tifffile.TiffWriter(path) as writer:
            for page in stack:
                writer.write(page, contiguous=False)
    else:
        first, *others = map(Image.fromarray, stack)
        first.save(path, save_all=True, append_images=others)
    with pytest.raises(RaptorError, match=r"holds 3 pages .*give --page 1 to 3"):
        read_picture(path)
    assert np.abs(read_pixels(path, page=2).colours[..., 0] * 255 - stack[1]).max() < 3
    with pytest.raises(RaptorError, match="has no page 4; it holds 3"):
        read_pixels(path, page=4)


def test_what_a_file_is_is_said_whatever_its_name(tmp_path):
    (tmp_path / "a.png").write_bytes(b"%PDF-1.7 rest")
    (tmp_path / "b.jpg").write_bytes(b"\0\0\0\x18ftypheic rest of it")
    Image.new("L", (13_000, 12_000)).save(tmp_path / "c.png")
    for name, message in (
        ("a.png", "looks like PDF"),
        ("b.jpg", "looks like HEIC"),
        ("c.png", "13000 x 12000"),
    ):
        with pytest.raises(RaptorError, match=message):
            read_picture(tmp_path / name)


def test_a_tissue_told_by_colour_alone(tmp_path):
    """Red tissue on a green floor of the same luminance."""
    colours = np.full((300, 300, 3), (90, 90, 90), np.uint8)
    colours[60:240, 60:240] = (0, 143, 60)
    colours[100:200, 100:200] = (243, 50, 70)
    noise = np.random.default_rng(1).normal(0, 4, colours.shape)
    Image.fromarray(np.clip(colours + noise, 0, 255).astype(np.uint8)).save(tmp_path / "a.png")
    mould = raptor.Mould(raptor.read_mould("free_square").outline)
    marks = ["59.5,239.5=-12,-12", "239.5,59.5=12,12"]
    picture = read_picture(tmp_path / "a.png", channel="hue")
    found = measure(picture, mould, register(picture, mould, marks))
    assert found.width_ratio == pytest.approx(100 / 180, abs=0.02)
    with pytest.raises(RaptorError, match="allowed are red, green, blue, saturation, hue"):
        read_picture(tmp_path / "a.png", channel="purple")


def test_a_locked_file_is_not_called_damaged(tmp_path):
    path = tmp_path / "fields.nc"
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("x", 3)
    command = f"import netCDF4; f = netCDF4.Dataset({str(path)!r}, 'a'); print('open', flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as writer:
        assert writer.stdout is not None
        assert writer.stdout.readline() == "open\n"
        with pytest.raises(RaptorError, match="is locked by another process") as caught, open_file(path):
            pass
        assert "delete" not in str(caught.value)
        writer.communicate("\n")
    with open_file(path) as file:
        assert list(file.dimensions) == ["x"]


def test_a_forbidden_file_keeps_its_cause(tmp_path, monkeypatch):
    """Root may read everything, so the system's answer is put in its place."""
    path = tmp_path / "model.json"
    path.write_text("{}")

    def forbidden(self):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", forbidden)
    for read in (read_json, partial(read_input, what="mould", expected="a mould"), read_yaml):
        with pytest.raises(RaptorError, match=r"(may not be read|Permission denied)") as caught:
            read(path)
        assert isinstance(caught.value.__cause__, PermissionError)


def test_nobody_is_told_to_delete_data():
    """Files of the user's may be locked, forbidden or wanted; a drawing's parts are another matter."""
    rooms = ("core", "dataset", "surrogate", "studies", "fitting", "imaging", "cli", "config")
    package = Path(raptor.__file__).parent
    for source in (path for room in rooms for path in (package / room).rglob("*.py")):
        assert not re.search(r"\bdelete\b", source.read_text(encoding="utf-8")), source


def test_a_shard_cut_short_says_what_is_missing(tmp_path):
    with create(tmp_path / "0-1.nc", "a shard", "theirs"):
        pass
    with pytest.raises(RaptorError, match=r"cannot be read whole .*move it to another folder"):
        read_shard(tmp_path / "0-1.nc")


HOLDER = """
import sys
from pathlib import Path
from raptor.core.jobs import hold_lock
hold_lock(Path(sys.argv[1]), "results")
print("held", flush=True)
input()
"""


def test_a_lock_names_its_holder_and_dies_with_it(tmp_path):
    path = tmp_path / ".snakemake" / "laptop.lock"
    command = [sys.executable, "-c", HOLDER, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(RaptorError, match=f"results is being made by process {holder.pid} on"):
            hold_lock(path, "results")
        holder.kill()
    hold_lock(path, "results")


def test_the_command_line_takes_one_thread_unless_told(monkeypatch):
    for given, wanted in ((None, "1"), ("3", "3")):
        monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
        if given:
            monkeypatch.setenv("OMP_NUM_THREADS", given)
        with pytest.raises(SystemExit):
            main(["moulds", "--help"])
        assert os.environ["OMP_NUM_THREADS"] == wanted


def test_a_folder_that_may_not_be_written_is_named_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)  # root may write everywhere
    with pytest.raises(RaptorError, match=f"folder {tmp_path} may not be written"):
        require_writable(tmp_path / "tissue.nc")


@pytest.mark.parametrize("encoding", ["latin-1", "utf-16"])
def test_a_configuration_in_another_encoding_is_named_by_workflow_env(encoding, tmp_path):
    (tmp_path / "größe.yaml").write_text("# Größe\nname: a\n", encoding=encoding)
    command = [DATA.parents[1] / "workflow" / "env", "snakemake", "--configfile", "größe.yaml"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "größe.yaml is not UTF-8 text" in done.stderr
