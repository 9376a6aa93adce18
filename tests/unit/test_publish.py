"""A published folder: opened by what others use, brought back from a server, verified."""

import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
import yaml
from typer.testing import CliRunner

from raptor.cli import app
from raptor.core.errors import RaptorError
from raptor.dataset.check import check
from raptor.dataset.design import read_design
from raptor.dataset.fetch import fetch
from raptor.dataset.publish import MANIFEST, place, publish, read_manifest
from raptor.dataset.stack import read_samples
from raptor.surrogate.rules import SHIPPED
from tests.small import CAMPAIGN, MINI, ROOT

STACK = "campaigns/paper/fields.nc"


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "publish"
    model = {name: SHIPPED / name for name in ("weights.safetensors", "model.json")}
    publish(folder, MINI, ["paper"], model | {"README.md": SHIPPED / "card.md"}, ROOT)
    return folder


def test_it_is_whole_and_every_netcdf_states_its_licence(published):
    assert check(published, 0.1) == []
    made = {path.relative_to(published).as_posix() for path in published.rglob("*") if path.is_file()}
    assert {
        "README.md", "croissant.json", "ro-crate-metadata.json", MANIFEST, "code/Snakefile", "code/LICENSE",
        "code/workflow/rules/publish.smk", "code/workflow/scripts/publish.py", "code/workflow/env",
        "code/config/laptop.yaml", "code/src/raptor/__init__.py", "surrogate/README.md",
        "surrogate/weights.safetensors", "campaigns/paper/card.md", "campaigns/paper/design.csv",
        "campaigns/paper/moulds.geojson", "campaigns/paper/shards/00000-00007.nc",
        "well/paper/data/test/raptor.hdf5",
    } <= made  # fmt: skip
    for path in published.rglob("*.nc"):
        with xr.open_dataset(path) as file:
            assert file.attrs["license"].startswith("CC-BY-4.0")


def test_xarray_opens_the_stack(published):
    with xr.open_dataset(published / STACK) as stack:
        assert stack["fields"].dims == ("sample", "field", "y", "x")
        assert stack["fields"].sizes["sample"] == 24


def test_mlcroissant_validates_and_reads_the_runs(published):
    import mlcroissant

    dataset = mlcroissant.Dataset(published / "croissant.json")
    assert dataset.metadata.license == ["https://creativecommons.org/licenses/by/4.0/"]
    records = list(dataset.records("paper"))
    runs = read_design(CAMPAIGN / "design.csv")
    assert [record["paper/simulation"] for record in records] == [run.simulation for run in runs]
    assert records[3]["paper/delta"] == pytest.approx(runs[3].parameters.delta)
    stated = {file.id: file.sha256 for file in dataset.metadata.distribution}
    sums = read_manifest((published / MANIFEST).read_text(), MANIFEST)
    assert stated.items() <= sums.items()
    assert sums.keys() - stated.keys() == {"croissant.json", "ro-crate-metadata.json"}


def test_the_well_s_layout_is_read_as_its_loader_reads_it(published):
    """As WellDataset does: counts from the root, constant scalars, fields of each order by their names."""
    with h5py.File(published / "well" / "paper" / "data" / "test" / "raptor.hdf5") as file:
        assert file.attrs["n_trajectories"] == 4
        assert file.attrs["license"].startswith("CC-BY-4.0")
        steps = file["dimensions"]["time"].shape[-1]
        sizes = [file["dimensions"][axis].shape[-1] for axis in file["dimensions"].attrs["spatial_dims"]]
        scalars = {name: file["scalars"][name][0] for name in file["scalars"].attrs["field_names"]}
        shapes = {}
        for order in (0, 1, 2):
            for name in file[f"t{order}_fields"].attrs["field_names"]:
                field = file[f"t{order}_fields"][name]
                assert field.attrs["sample_varying"]
                times = [steps] if field.attrs["time_varying"] else []  # the masks do not vary
                assert field.shape == (4, *times, *sizes, *([2] * order))
                shapes[name] = field[0]
    rows = [row for row, run in enumerate(read_design(CAMPAIGN / "design.csv")) if run.split == "test"]
    (sample,) = read_samples(CAMPAIGN / "fields.nc", rows[:1])
    assert scalars["delta"] == pytest.approx(sample.parameters.delta)
    assert np.array_equal(shapes["density"][0], sample.fields[0].T)


def test_the_crate_is_read_and_says_what_made_what(published):
    from rocrate.rocrate import ROCrate

    crate = ROCrate(published)
    assert crate.mainEntity.id == "code/Snakefile"
    (action,) = (entity for entity in crate.get_entities() if entity.type == "CreateAction")
    assert action["instrument"] == crate.mainEntity
    assert STACK in {entity.id for entity in action["result"]}
    assert "creativecommons" in crate.root_dataset["license"].id


def test_the_header_of_the_card_is_what_hubs_read(published):
    header = yaml.safe_load((published / "README.md").read_text().split("---\n")[1])
    assert header["license"] == "cc-by-4.0"


class Handler(SimpleHTTPRequestHandler):
    """Serves a folder, byte ranges too; ends the answer early where `server.short` says."""

    def log_message(self, *arguments):
        pass

    def do_GET(self):
        path = Path(self.translate_path(self.path))
        if not path.is_file():
            self.send_error(404, "Not Found")
            return
        content = path.read_bytes()
        start = int(self.headers.get("Range", "bytes=0-").removeprefix("bytes=").rstrip("-"))
        if start and self.server.ranges:
            if start >= len(content):
                self.send_error(416)
                return
            self.send_response(206)
            content = content[start:]
        else:
            self.send_response(200)
        self.server.asked.append((self.path, start))
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        short = self.server.short.pop(path.name, None)
        self.wfile.write(content[:short])


@pytest.fixture
def server(published):
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=str(published))) as running:
        running.ranges, running.short, running.asked = True, {}, []
        threading.Thread(target=running.serve_forever, daemon=True).start()
        running.address = f"http://127.0.0.1:{running.server_port}"
        yield running
        running.shutdown()


@pytest.mark.parametrize("ranges", [True, False])
def test_a_broken_download_goes_on_and_ends_whole(server, tmp_path, ranges):
    server.ranges, server.short = ranges, {"fields.nc": 100_000}
    folder = tmp_path / "here"
    with pytest.raises(RaptorError, match=r"fields.nc: the connection ended \d+ bytes early; give the same"):
        fetch(server.address, folder)
    assert not (folder / STACK).exists()
    assert (folder / STACK).with_name(".fields.nc.part").stat().st_size == 100_000
    assert not (folder / MANIFEST).exists()
    server.asked.clear()
    done = CliRunner().invoke(app, ["fetch", server.address, "--output", str(folder)])
    assert done.exit_code == 0, done.output
    assert "every checksum right" in done.output
    assert (f"/{STACK}", 100_000) in server.asked
    assert ("/campaigns/paper/design.csv", 0) not in server.asked  # it was there already
    assert check(folder, 0.1) == []
    assert not list(folder.rglob(".*.part"))


def test_a_folder_is_fetched_from_a_path_too(published, tmp_path):
    count = fetch(str(published), tmp_path / "copy")
    assert count == len(read_manifest((published / MANIFEST).read_text(), MANIFEST))
    assert (tmp_path / "copy" / MANIFEST).read_bytes() == (published / MANIFEST).read_bytes()


def test_what_cannot_be_fetched_is_said_in_one_sentence(server, published, tmp_path):
    for source, message in (
        (f"{server.address}/none", "the server answers 404"),
        ("http://127.0.0.1:9", "cannot be reached: .*refused"),
        (str(tmp_path), "SHA256SUMS does not exist; give a folder that the rule publish made"),
    ):
        with pytest.raises(RaptorError, match=message):
            fetch(source, tmp_path / "here")
    (tmp_path / "here" / "README.md").parent.mkdir(exist_ok=True)
    (tmp_path / "here" / "README.md").write_text("mine")
    with pytest.raises(RaptorError, match="is there already and differs"):
        fetch(str(published), tmp_path / "here")
    assert (tmp_path / "here" / "README.md").read_text() == "mine"


@pytest.mark.parametrize("name", ["../escape", "/etc/passwd", "a/../../b", ""])
def test_a_manifest_cannot_name_a_file_elsewhere(name):
    with pytest.raises(RaptorError, match="line 1 is not a SHA-256 and the path of a file of the folder"):
        read_manifest(f"{'0' * 64}  {name}\n", "manifest")


def test_damage_is_found(published, tmp_path):
    source = tmp_path / "copy"
    fetch(str(published), source)
    (source / "README.md").write_text("changed")
    (source / "campaigns" / "paper" / "card.md").unlink()
    (source / "more.txt").write_text("not listed")
    faults = check(source, 0.1)
    assert any(fault.startswith("README.md does not have the checksum") for fault in faults)
    assert any(fault.startswith("campaigns/paper/card.md is in SHA256SUMS but missing") for fault in faults)
    assert "more.txt is not in SHA256SUMS" in faults
    with pytest.raises(RaptorError, match=r"README.md from .* does not have the checksum"):
        fetch(str(source), tmp_path / "again")
    assert not (tmp_path / "again" / "README.md").exists()


def test_files_of_the_run_take_no_room_twice(tmp_path):
    """Hard links, unless a file has to state its licence first."""
    plain = tmp_path / "design.csv"
    plain.write_text("a")
    place(plain, tmp_path / "published" / "design.csv")
    assert plain.stat().st_ino == (tmp_path / "published" / "design.csv").stat().st_ino
    with pytest.raises(RaptorError, match="does not exist; make it with the workflow"):
        place(tmp_path / "none.csv", tmp_path / "published" / "none.csv")
    with pytest.raises(RaptorError, match=r"design\.csv/below cannot be written: "):
        place(plain, plain / "below")
