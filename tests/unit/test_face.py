"""`import raptor`: what it gives, as docs/python.md shows it, and what it costs."""

import ast
import subprocess
import sys

import numpy as np
import pytest
import shapely
import xarray as xr

import raptor
from raptor.dataset.check import check
from raptor.fields.labelled import mould_of
from raptor.plotting import curve_figure
from raptor.symmetry import FIELDS
from tests.small import ROOT

HEAVY = ("matplotlib", "netCDF4", "numba", "numpy", "pandas", "scipy", "shapely", "torch", "typer", "xarray")


def test_importing_raptor_loads_nothing_heavy():
    script = f"import raptor, sys; print([m for m in {HEAVY} if m in sys.modules], raptor.__doc__[:6])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "[] RAPTOR\n"


def test_the_command_line_loads_only_what_a_command_needs():
    script = f"import raptor.cli, sys; print({set(HEAVY) - {'numpy', 'typer'}} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_every_name_of_the_face_is_there_and_documented():
    stub = ast.parse((ROOT / "src" / "raptor" / "__init__.pyi").read_text())
    (listed,) = (ast.literal_eval(node.value) for node in stub.body if isinstance(node, ast.Assign))
    assert sorted(listed) == sorted(raptor.__all__) == sorted(dir(raptor))
    for name in listed:
        assert getattr(raptor, name).__doc__
    with pytest.raises(AttributeError):
        _ = raptor.simulated


@pytest.fixture(scope="module")
def mould():
    return raptor.read_mould(ROOT / "tests" / "data" / "moulds" / "dog_bone.svg")


@pytest.fixture(scope="module")
def tissue(mould):
    cells = raptor.CellParameters(0.5, 0.5, 0.3)
    return raptor.simulate(mould, cells, layers=1, accuracy="draft", seed=0)


def test_a_simulated_tissue_says_what_it_is(tissue, mould):
    assert tissue.mould is mould
    assert tissue.parameters == raptor.CellParameters(0.5, 0.5, 0.3)
    assert (tissue.layers, tissue.accuracy, tissue.seed) == (1, "draft", 0)
    assert 0.3 < tissue.width_ratio < 1
    assert 0.3 < tissue.area_ratio < 1


def test_its_fields_have_names_units_masks_and_the_mould(tissue, mould):
    fields = tissue.fields(64)
    assert tuple(fields.data_vars) == FIELDS
    assert dict(fields.sizes) == {"y": 64, "x": 64, "tether": len(mould.tethers)}
    assert all({"units", "long_name"} <= set(fields[name].attrs) for name in fields.variables)
    assert float(fields.density.sum()) == pytest.approx(tissue.cells)
    assert np.allclose(fields.sxsx + fields.sysy + fields.szsz, fields.density)
    assert not (fields.depression & fields.tethers).any()
    assert float(fields.density.where(fields.tethers, 0).sum()) < 0.1 * tissue.cells
    assert float(fields.delta) == 0.5
    again = mould_of(fields)
    assert again.outline.equals(mould.outline)
    assert (again.tethers, again.name) == (mould.tethers, mould.name)


def test_a_mould_by_name_and_a_tissue_by_name():
    cells = raptor.tissue("glial_1").fit
    made = raptor.simulate("small_rectangle", cells, layers=1, accuracy="draft")
    assert made.mould.name == "small_rectangle"
    square = raptor.Mould(
        shapely.box(-5, -5, 5, 5), tethers=[raptor.Circle(0, 2, 1), shapely.box(-3, -3, 3, -2)]
    )
    assert len(square.tethers) == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mould": "small_rectangel"}, "did you mean 'small_rectangle'"),
        ({"mould": 3}, "a mould is of type int; give a raptor.Mould, a library name or a file"),
        ({"cells": raptor.tissue("glial_1")}, "the fit of a tissue: raptor.tissue"),
        ({"layers": 0}, "layers is 0; 1 to 64 are allowed"),
        ({"accuracy": "best"}, "allowed are draft, standard, reference"),
        ({"seed": -1}, "seed is -1; give a whole number, 0 or more"),
    ],
)
def test_bad_arguments_are_named(change, message):
    arguments = {"mould": "small_rectangle", "cells": raptor.CellParameters(0.5, 0.5, 0.3), **change}
    with pytest.raises(raptor.RaptorError, match=message):
        raptor.simulate(**arguments)


@pytest.fixture(scope="module")
def prediction(mould):
    return raptor.predict(mould, raptor.CellParameters(0.5, 0.5, 0.3))


def test_a_prediction_has_fields_ratios_and_bands(prediction, mould):
    fields = prediction.fields
    assert tuple(fields.data_vars) == FIELDS
    assert prediction.mould is mould
    assert float(fields.density.sum()) == pytest.approx(fields.attrs["n_cells"], rel=1e-3)
    low, high = prediction.area_ratio_band
    assert low < prediction.area_ratio < high
    low, high = prediction.width_ratio_band
    assert low < prediction.width_ratio < high
    assert float(fields.area_ratio) == prediction.area_ratio == prediction.numbers["area_ratio"]
    assert prediction.out_of_distribution is (max(prediction.distance, prediction.disagreement) > 1)
    assert f"A/A0 {prediction.area_ratio:.3f} +- " in str(prediction)
    whole = prediction.to_dataset()
    assert set(whole.data_vars) == {*FIELDS, *(f"{name}_std" for name in FIELDS)}
    half = float(whole.area_ratio_band.sel(level=0.95))
    assert prediction.area_ratio_band[1] - prediction.area_ratio == pytest.approx(half)


def test_the_shipped_surrogate_is_loaded_once():
    assert raptor.load_surrogate() is raptor.load_surrogate()


@pytest.mark.parametrize("kind", ["tissue", "prediction"])
def test_a_result_is_saved_drawn_and_read_again(kind, request, tmp_path):
    result, path = request.getfixturevalue(kind), tmp_path / "result.nc"
    raptor.save(result, path)
    fields = raptor.load_fields(path)
    assert check(path) == []
    assert mould_of(fields) == result.mould
    assert fields.density.dtype == np.float32
    assert np.allclose(fields.density, result.to_dataset().density, atol=1e-6)
    figures = [raptor.plot(what, fields=True) for what in (result, fields)]
    images = [figure.axes[1].images[0].get_array() for figure in figures]
    assert np.allclose(*images, atol=1e-6)
    assert figures[0].axes[1].get_ylabel() == ("simulation" if kind == "tissue" else "prediction")


@pytest.mark.parametrize("kind", ["tissue", "prediction"])
def test_the_picture_of_a_tissue_says_its_numbers_and_marks_lost_tethers(kind, request):
    fields = request.getfixturevalue(kind).to_dataset()
    said = texts(fields)
    assert f"{float(fields.area_ratio):.3f}" in said
    assert (" $\\pm$ " in said) == (kind == "prediction")
    count = fields.held.size
    assert f"{count} of {count} held" in said
    lost = fields.assign_coords(held=("tether", [0.0] + [1.0] * (count - 1)))
    assert f"{count - 1} of {count} held; lost: 1" in texts(lost)
    assert "unusual" in texts(fields.assign_attrs(unusual="longest tether 24 l0"))


def test_a_curve_of_a_mould_is_predicted_and_simulated(tmp_path):
    cells = [raptor.CellParameters(delta, 0.5, 0.25) for delta in (0.2, 0.6)]
    predictions = raptor.predict("small_rectangle", cells)
    assert predictions[1].area_ratio == raptor.predict("small_rectangle", cells[1]).area_ratio
    table = raptor.sweep("small_rectangle", cells, simulations=2)
    assert table["delta"].tolist() == [0.2, 0.6]
    assert table["area_ratio"].tolist() == [each.area_ratio for each in predictions]
    for name in ("area_ratio", "simulated_area_ratio", "width_ratio", "simulated_width_ratio"):
        assert table[name].is_monotonic_decreasing
    assert (table["simulated_area_ratio_std"] < 0.1).all()
    axes = curve_figure(table, "small_rectangle").axes
    assert np.allclose(axes[0].lines[0].get_xydata(), table[["delta", "area_ratio"]])
    with pytest.raises(raptor.RaptorError, match="delta"):
        raptor.sweep("small_rectangle", [raptor.CellParameters(0.97, 0.5, 0.25)])


def texts(fields):
    """All that the picture of a tissue says."""
    return " ".join(text.get_text() for axes in raptor.plot(fields).axes for text in axes.texts)


def test_a_mould_is_drawn_and_a_notebook_shows_it():
    figure = raptor.plot("small_rectangle")
    assert "26 x 13 l0" in figure.axes[0].get_title(loc="left")
    assert figure._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(raptor.RaptorError, match="cannot draw an object of type int"):
        raptor.plot(3)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "does not exist"),
        (b"text", "is not netCDF: its content looks like none"),
        (True, "not hold the fields"),
    ],
)
def test_a_file_that_is_no_result_is_named(content, message, tmp_path):
    path = tmp_path / "result.nc"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content:
        xr.Dataset({"a": 3}).to_netcdf(path)
    with pytest.raises(raptor.RaptorError, match=message):
        raptor.load_fields(path)


def test_a_fit_finds_parameters_and_says_what_is_left_open(tissue, mould):
    """By the simulator from parameters of one's own, which needs no surrogate and few simulations."""
    start = raptor.CellParameters(0.45, 0.5, 0.3)
    found = raptor.fit(
        mould, tissue.area_ratio, tissue.width_ratio, by="simulator", start=start, layers=1, accuracy="draft",
        simulations=8,
    )  # fmt: skip
    assert found.parameters.delta == pytest.approx(0.5, abs=0.08)
    assert found.rank < 3
    assert found.numbers["delta"] == found.parameters.delta
    assert "other parameters fit equally well" in str(found)
    assert found.tissue.parameters == found.parameters
    assert found.apart(mould.outline.buffer(-1)) > 0
    assert len(raptor.plot(found).axes) == 6  # tissue and its scale, words, three parameters


def test_a_fit_takes_an_outline_in_l0(mould):
    tissue = mould.outline.buffer(-1)
    start = raptor.CellParameters(0.2, 0.5, 0.3)
    options = {"by": "simulator", "start": start, "layers": 1, "accuracy": "draft", "simulations": 2}
    found = raptor.fit(mould, outline=tissue, **options)
    assert 0 < found.distance < 2
    assert found.numbers["distance"] == found.distance


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "give one kind of measurement"),
        ({"area_ratio": 0.7, "outline": "a.png"}, "give one kind of measurement"),
        ({"area_ratio": 70}, "lies between 0 and 1.5"),
        ({"area_ratio": 0.7, "by": "eye"}, "allowed are corrected, surrogate, simulator"),
        (
            {"area_ratio": 0.7, "start": raptor.CellParameters(0.5, 0.5, 0.3)},
            "start parameters need a fit by the simulator",
        ),
        ({"area_ratio": 0.7, "error": 0.0}, "error is 0.0; give a positive number"),
        ({"outline": shapely.LineString([(0, 0), (9, 9)])}, "the outline holds no polygon"),
        ({"outline": shapely.box(0, 0, 90, 9)}, "the outline leaves the frame"),
        ({"area_ratio": 0.7, "layers": 3}, "layers is 3, but this surrogate is for 7"),
        ({"area_ratio": 0.7, "surrogate": "nowhere"}, "model.json cannot be read"),
    ],
)
def test_a_fit_that_cannot_be_made_is_named(arguments, message):
    with pytest.raises(raptor.RaptorError, match=message):
        raptor.fit("small_rectangle", **arguments)


def test_fields_without_a_mould_are_named(tissue):
    with pytest.raises(raptor.RaptorError, match="these fields have no mould"):
        mould_of(tissue.fields(32).drop_attrs())
