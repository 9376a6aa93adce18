"""Design, shards, stack, examples, scaling, checks: on a data set made here, small but real."""

import shutil
from dataclasses import replace

import h5py
import netCDF4
import numpy as np
import pytest
import shapely

from raptor.core.errors import RaptorError
from raptor.dataset import run as running
from raptor.dataset import shards
from raptor.dataset.card import card
from raptor.dataset.check import check
from raptor.dataset.compare import differences
from raptor.dataset.design import read_design
from raptor.dataset.examples import list_examples, read_examples, training_scaling
from raptor.dataset.progress import progress_of
from raptor.dataset.scaling import Scaling, fit_scaling, scale_inputs
from raptor.dataset.shards import read_shard
from raptor.dataset.stack import build_stack, read_samples, read_table
from raptor.dataset.well import write_well
from raptor.fields.tethers import contact, held
from raptor.moulds import Mould, moulds_by_id, read_moulds
from raptor.moulds.cast import CastMould
from raptor.parameters import CellParameters
from raptor.symmetry import FIELDS, Element, apply
from tests.small import build, design

pytestmark = pytest.mark.one_processor


@pytest.fixture
def folder(made, tmp_path):
    """A copy to spoil."""
    shutil.copytree(made, tmp_path / "unit")
    return tmp_path / "unit"


def test_the_data_set_keeps_its_rules(made):
    assert check(made) == []
    assert check(made / "shards" / "0.nc") == []
    assert check(made / "fields.nc") == []


def test_other_shards_give_the_same_data(made, tmp_path):
    assert differences(made, build(tmp_path / "unit", 2)) == []


def test_a_variable_of_one_data_set_alone_is_a_difference(made, folder):
    with netCDF4.Dataset(folder / "fields.nc", "a") as file:
        file.createVariable("added", "f8", ())
    assert differences(made, folder) == differences(folder, made) == ["fields.nc: added differs"]


def edit(path, name, change):
    with netCDF4.Dataset(path, "a") as file:
        file.set_auto_mask(False)
        values = file[name][:]
        change(values)
        file[name][:] = values


def test_a_swapped_sign_is_named(folder):
    def swap(fields):
        fields[2, 5] *= -1

    edit(folder / "fields.nc", "fields", swap)
    (fault,) = check(folder)
    assert "simulation 2" in fault
    assert "sxsy has the opposite sign" in fault


def test_a_swapped_sign_of_an_orientation_is_named(folder):
    def swap(sx):
        sx[:50] *= -1

    edit(folder / "shards" / "0.nc", "sx", swap)
    assert any("energy is" in fault and "recomputed" in fault for fault in check(folder))


def test_a_mould_in_two_splits_is_named(folder):
    splits = read_table(folder / "fields.nc").split
    one, two = splits.index("train"), splits.index("test")

    def copy(masks):
        masks[two] = np.rot90(masks[one])

    for name in ("depression", "tethers"):
        edit(folder / "fields.nc", name, copy)
    assert any("one mould in two splits" in fault for fault in check(folder))


def test_nan_is_named(folder):
    def spoil(fields):
        fields[1, 3, 5, 5] = np.nan

    edit(folder / "fields.nc", "fields", spoil)
    assert any("simulation 1: NaN or infinity in sysy" in fault for fault in check(folder))


def test_nan_in_what_a_solver_reports_is_named(folder):
    def spoil(gradient):
        gradient[0] = np.nan

    edit(folder / "shards" / "0.nc", "gradient", spoil)
    assert check(folder) == ["unit: 0.nc: NaN or infinity in gradient"]


def test_negative_density_lost_cells_and_a_broken_trace_are_named(folder):
    def spoil(fields):
        fields[0, 0] -= 0.1

    edit(folder / "fields.nc", "fields", spoil)
    faults = " ".join(check(folder / "fields.nc"))
    for what in ("density is negative", "density sums to", "sxsx + sysy + szsz is not density"):
        assert what in faults


def test_shards_and_stack_say_which_tethers_are_held(made):
    moulds, runs = moulds_by_id(made / "moulds.geojson"), read_design(made / "design.csv")
    table = read_table(made / "fields.nc")
    lost = dict(zip(table.simulation.tolist(), table.measures["posts_lost"].tolist(), strict=True))
    for path in (made / "shards").glob("*.nc"):
        for record in read_shard(path).records:
            cast = CastMould(moulds[runs[record.simulation].mould], 2, 32)
            assert record.held == pytest.approx(held(record.positions, cast), nan_ok=True)
            assert record.contact == pytest.approx(contact(record.positions, cast), abs=0.02)
            assert lost[record.simulation] == record.posts_lost
    assert (np.abs(table.measures["alignment"]) < 1).all()
    assert (table.measures["anisotropy"] > 0).all()


def test_wrong_measures_are_named(folder):
    edit(folder / "fields.nc", "posts_lost", lambda values: values.__iadd__(1))
    edit(folder / "fields.nc", "alignment", lambda values: values.__imul__(-1))
    faults = check(folder)
    assert any("posts_lost is" in fault for fault in faults)
    assert any("alignment is" in fault for fault in faults)


def test_an_example_of_the_test_split_and_a_double_one_are_named(folder):
    path = folder / "examples.csv"
    held_out = read_table(folder / "fields.nc").split.index("test")
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines, lines[1], f"{held_out},0"]) + "\n")
    faults = " ".join(check(folder))
    assert "listed twice" in faults
    assert f"sample {held_out} is held out" in faults


def test_a_truncated_shard_is_named(folder):
    path = folder / "shards" / "0.nc"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert any("0.nc is truncated or damaged" in fault for fault in check(folder))
    with pytest.raises(RaptorError, match="is truncated"):
        read_shard(path)


def test_a_shard_of_another_configuration_is_named(made):
    with pytest.raises(RaptorError, match="made by configuration c, model version 3, and not other, 3"):
        read_shard(made / "shards" / "0.nc", "other")


def test_a_missing_simulation_is_named(made, tmp_path):
    runs = read_design(made / "design.csv")
    moulds = {r.mould: Mould(shapely.box(-9, -9, 9, 9)) for r in runs}
    with pytest.raises(RaptorError, match=r"simulations \[4, 5\] are in no shard"):
        build_stack(
            tmp_path / "fields.nc", [made / "shards" / "0.nc"], runs, moulds, 32,
            simulation_configuration="c", configuration="d",
        )  # fmt: skip
    assert not list(tmp_path.iterdir())


def test_the_design_keeps_its_counts_and_bounds(made):
    runs = read_design(made / "design.csv")
    assert [sum(r.split == s for r in runs) for s in ("train", "validation", "test")] == [3, 1, 2]
    assert sum(r.own["edge"] == "True" for r in runs) == 2
    for run in runs:
        run.parameters.require_sampled("design")
        assert run.own["edge"] == str(run.parameters.delta in (0.05, 0.95))
    assert len({r.seed for r in runs}) == len({r.mould for r in runs}) == 6


def test_a_run_depends_on_its_number_and_its_campaign_alone():
    few, many, other = (
        given.make()
        for given in (design(runs=4, edge=0), design(runs=9, edge=0), design("other", runs=4, edge=0))
    )
    assert few[1] == many[1][:4]
    assert [(r.parameters, r.seed) for r in few[0]] == [(r.parameters, r.seed) for r in many[0][:4]]
    assert {r.seed for r in few[0]}.isdisjoint(r.seed for r in other[0])
    assert few[1][0] != other[1][0]


def test_a_spoilt_design_is_named(made, tmp_path):
    text = (made / "design.csv").read_text()
    for old, new, message in (
        ("train", "trian", "line .*split is 'trian'"),
        ("simulation,", "simulations,", "columns"),
        (",test,", ",test,x", "could not convert"),
    ):
        path = tmp_path / "design.csv"
        path.write_text(text.replace(old, new, 1))
        with pytest.raises(RaptorError, match=message):
            read_design(path)


def test_examples_are_the_distinct_images_of_train_and_validation(made):
    stack = made / "fields.nc"
    table = read_table(stack)
    examples = list_examples(stack)
    assert {table.split[e.sample] for e in examples} == {"train", "validation"}
    assert all(sum(e.sample == row for e in examples) in (1, 2, 4, 8) for row in table.rows("train"))
    assert {e.sample for e in examples if e.element == 0} == set(table.rows("train", "validation"))


def test_scaling_is_of_the_training_split_and_commutes_with_d4(made):
    stack = made / "fields.nc"
    scaling = training_scaling(stack)
    train = [s.fields for s in read_samples(stack, read_table(stack).rows("train"))]
    scaled = np.stack([scaling.forward(fields) for fields in train])
    assert np.abs(scaled).max() <= 1 + 1e-6
    assert np.stack([scaling.inverse(s) for s in scaled]) == pytest.approx(np.stack(train), abs=1e-5)
    for element in Element.all():
        direct = scaling.forward(apply(train[0], element))
        assert direct == pytest.approx(apply(scaling.forward(train[0]), element), abs=1e-6)


def test_scaling_survives_json():
    scaling = fit_scaling(-np.arange(8.0), np.arange(8.0) + 1)
    assert Scaling.from_json(scaling.as_json()) == scaling


def test_inputs_are_images_and_constants_in_minus_one_to_one():
    masks = np.eye(4, dtype=np.uint8)
    inputs = scale_inputs(np.stack([masks, 1 - masks, masks]), CellParameters(0.95, 0.1, 0.01))
    assert inputs.shape == (6, 4, 4)
    assert set(np.unique(inputs[:3])) == {-1, 1}
    assert [float(c[0, 0]) for c in inputs[3:]] == pytest.approx([1, -1, -1])


def test_a_failed_simulation_is_recorded_and_the_rest_survives(made, tmp_path, monkeypatch):
    """One simulation raises, one gives NaN, one fails but once; the data set states the two that are lost."""
    folder = tmp_path / "unit"
    really, tries = running.simulate, []

    def sometimes(mould, parameters, model, accuracy, seed):
        number = next(run.simulation for run in runs if run.seed == seed)
        tries.append(number)
        if number == 1 or tries == [0, 1, 1, 2]:
            raise FloatingPointError("no room")
        made_one = really(mould, parameters, model, accuracy, seed)
        return replace(made_one, energy=np.nan) if number == 4 else made_one

    runs = read_design(made / "design.csv")
    monkeypatch.setattr(running, "simulate", sometimes)
    build(folder, 3)
    assert tries == [0, 1, 1, 2, 2, 3, 4, 4, 5]
    found = shards.read_shard(folder / "shards" / "0.nc")
    assert [record.simulation for record in found.records] == [0, 2]
    assert found.failures == {1: "FloatingPointError: no room"}
    stack = folder / "fields.nc"
    assert read_table(stack).simulation.tolist() == [0, 2, 3, 5]
    assert check(folder) == []
    parts = [shards.read_shard(folder / "shards" / f"{n}.nc") for n in (0, 3)]
    moulds = read_moulds(folder / "moulds.geojson")
    examples = read_examples(folder / "examples.csv")
    text = card("unit", runs, moulds, parts, stack, examples)
    assert "missing: 1 (FloatingPointError: no room); 4 (the solver met NaN or infinity)" in text


def test_a_split_without_simulations_stops_the_data_set(tmp_path, monkeypatch):
    def never(*arguments):
        raise ZeroDivisionError("never")

    monkeypatch.setattr(running, "simulate", never)
    with pytest.raises(RaptorError, match=r"every simulation of the split '\w+' failed"):
        build(tmp_path / "unit", 6)


def test_shards_of_two_devices_are_not_put_together(made, tmp_path):
    shutil.copytree(made, tmp_path / "unit")
    shards_made = sorted((tmp_path / "unit" / "shards").glob("*.nc"))
    with netCDF4.Dataset(shards_made[-1], "a") as file:
        file.device = "cuda"
    runs = read_design(made / "design.csv")
    moulds = {mould.name: mould for mould in read_moulds(made / "moulds.geojson")}
    with pytest.raises(RaptorError, match=r"made on .* and earlier ones on"):
        build_stack(
            tmp_path / "stack.nc",
            shards_made,
            runs,
            moulds,
            32,
            simulation_configuration="c",
            configuration="d",
        )


def test_the_wells_layout_holds_the_same_fields(made, tmp_path):
    stack = made / "fields.nc"
    table = read_table(stack)
    paths = write_well(stack, tmp_path)
    assert [path.relative_to(tmp_path).parts[1] for path in paths] == ["train", "valid", "test"]
    with h5py.File(paths[0]) as file:
        rows = table.rows("train")
        assert file.attrs["n_trajectories"] == len(rows)
        assert file.attrs["n_spatial_dims"] == 2
        assert list(file["dimensions"].attrs["spatial_dims"]) == ["x", "y"]
        assert set(file) >= {"boundary_conditions", "dimensions", "scalars"}
        for row, sample in enumerate(read_samples(stack, rows)):
            fields = dict(zip(FIELDS, sample.fields, strict=True))
            assert file["scalars/delta"][row] == pytest.approx(sample.parameters.delta)
            assert np.array_equal(file["t0_fields/density"][row, 0], fields["density"].T)
            assert np.array_equal(file["t0_fields/tethers"][row], sample.tethers.T)
            assert np.array_equal(file["t1_fields/out_of_plane"][row, 0, ..., 1], fields["sysz"].T)
            tensor = file["t2_fields/orientation"][row, 0]
            assert np.array_equal(tensor[..., 0, 1], fields["sxsy"].T)
            assert np.array_equal(tensor[..., 1, 1], fields["sysy"].T)
            trace = tensor[..., 0, 0] + tensor[..., 1, 1] + file["t0_fields/szsz"][row, 0]
            assert trace == pytest.approx(file["t0_fields/density"][row, 0], abs=1e-5)
        # What scripts/check_thewell_formatting.py and check_thewell_data.py of The Well ask for:
        sizes = {"time": 1, "x": table.pixels, "y": table.pixels}
        assert file["dimensions/time"].attrs["time_varying"]
        for name in file.attrs["simulation_parameters"]:
            values = file["scalars"][name][:]
            assert file.attrs[name] == pytest.approx([values.min(), values.max()])
        for name, boundary in file["boundary_conditions"].items():
            (axis,) = boundary.attrs["associated_dims"]
            assert name == f"{axis}_{boundary.attrs['bc_type'].lower()}"
            assert boundary.attrs["bc_type"] == "OPEN"
            assert boundary["mask"].shape == (sizes[axis],)
        for order in (0, 1, 2):
            group = file[f"t{order}_fields"]
            assert sorted(group.attrs["field_names"]) == sorted(group)
            for field in group.values():
                assert list(field.attrs["dim_varying"]) == [True, True]
                assert field.attrs["sample_varying"]
                time = (1,) if field.attrs["time_varying"] else ()
                assert field.shape == (len(rows), *time, table.pixels, table.pixels, *(2,) * order)


def test_a_part_of_the_simulations_is_computed_again(folder):
    def spoil(energy):
        energy += 1

    for shard in (folder / "shards").glob("*.nc"):
        edit(shard, "energy", spoil)
    everything, half = check(folder), check(folder, 0.5)
    assert len(everything) == 6
    assert len(half) == 3
    assert all("energy is" in fault for fault in everything + half)


def test_progress_counts_what_is_done(folder):
    assert progress_of(folder).done == 6
    assert progress_of(folder).seconds_left == 0
    (folder / "shards" / "4.nc").unlink()
    half = progress_of(folder)
    assert (half.designed, half.done, half.failed) == (6, 4, 0)
    assert 0 < half.seconds_left < float("inf")
    assert str(half).startswith("4 of 6 simulations done, 0 failed, ")
