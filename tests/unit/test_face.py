"""`import raptor`: what it gives, as docs/python.md shows it, and what it costs."""

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely

import raptor
from raptor.fields.labelled import mould_of
from raptor.symmetry import FIELDS

ROOT = Path(__file__).parents[2]
HEAVY = ("matplotlib", "netCDF4", "numba", "numpy", "pandas", "scipy", "shapely", "torch", "typer", "xarray")


def test_importing_raptor_loads_nothing_heavy():
    script = f"import raptor, sys; print([m for m in {HEAVY} if m in sys.modules], raptor.__doc__[:6])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "[] RAPTOR\n"


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
    assert dict(fields.sizes) == {"y": 64, "x": 64}
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
        ({"mould": 3}, "a mould is of type int; give a raptor.Mould, a name of the library or a file"),
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


def test_fields_without_a_mould_are_named(tissue):
    with pytest.raises(raptor.RaptorError, match="do not say in which mould"):
        mould_of(tissue.fields(32).drop_attrs())
