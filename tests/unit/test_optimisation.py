"""Searches for moulds: vectors, limits, measures of hand-made fields, what a search finds."""

import json

import numpy as np
import pytest
import shapely

import raptor
from raptor.frame import pixel_centres
from raptor.moulds import Circle, Mould, PolygonTether, read_mould
from raptor.moulds.cast import CastMould
from raptor.moulds.summary import symmetry_class
from raptor.moulds.writing import write_dxf, write_svg
from raptor.optimisation import command
from raptor.optimisation.casting import decode
from raptor.optimisation.evaluation import Evaluator
from raptor.optimisation.finalists import ranked, spread
from raptor.optimisation.genes import GENES, between, clear
from raptor.optimisation.measures import View, all_held, measure
from raptor.optimisation.search import search, undominated
from raptor.optimisation.spec import Measured, read_spec, with_changes
from raptor.raster import density_threshold
from raptor.symmetry import FIELDS
from tests.commands import raptor as command_line

LAYERS, PIXELS = 2, 64
SMALL = {
    "tissue": "glial_1",
    "objectives": [{"measure": "alignment"}, {"measure": "evenness"}],
    "mould_cells": [300, 900],
    "search": {"evaluations": 96, "population": 16, "refined": 0.3},
    "finalists": 2,
    "simulations": 0,
}


def spec(**changes):
    return read_spec(SMALL | changes)


def vector(**genes):
    """A rectangle of medium size with nothing in it, and genes of one's own."""
    plain = dict.fromkeys(GENES, 0.5) | {
        "ends": np.log(1 / 0.08) / np.log(2.5 / 0.08), "middle": 1.0, "flare": 1.0, "rounding": 0.0,
        "end_posts": 0.0, "rim_posts": 0.0, "centre": 0.0, "bars": 0.0, "which_end": 0.0,
    }  # fmt: skip
    return np.array(list((plain | genes).values()))


def decoded(x, **changes):
    return decode(np.asarray(x), spec(**changes), LAYERS, PIXELS)


def test_random_vectors_are_moulds_that_can_be_made_or_violations():
    wanted, made = spec(), 0
    for x in np.random.default_rng(1).random((60, len(GENES))):
        candidate = decode(x, wanted, LAYERS, PIXELS)
        assert (candidate.cast is None) == (candidate.violation > 0)
        if candidate.cast is None:
            continue
        made += 1
        mould = candidate.cast.mould
        assert mould.depression.geom_type == "Polygon"
        assert candidate.cells == CastMould(mould, LAYERS, PIXELS).n_cells
        assert min(clear(mould.outline, tether) for tether in mould.tethers) >= 1.2 - 1e-5
        for one in range(len(mould.tethers)):
            for other in range(one):
                assert between(mould.tethers[one], mould.tethers[other]) >= 1.5 - 1e-5
    assert made > 20


def test_posts_are_as_far_apart_as_their_polygons():
    one, other = Circle(0, 0, 1), Circle(5, 1, 2)
    assert between(one, other) == pytest.approx(one.polygon.distance(other.polygon), abs=1e-3)
    bar = PolygonTether(shapely.box(3, -1, 4, 1))
    assert between(one, bar) == pytest.approx(2.0)
    assert clear(shapely.box(-5, -5, 8, 5), bar) == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("genes", "tethers", "symmetry"),
    [
        ({"end_posts": 0.3}, 2, "mirrors"),  # one post at each end
        ({"end_posts": 0.3, "which_end": 0.7}, 1, "mirror"),
        ({"end_posts": 0.5, "end_spread": 1.0}, 4, "mirrors"),  # corners
        ({"rim_posts": 0.61, "rim_start": 0.0, "rim_inset": 0.0}, 4, "mirrors"),
        ({"centre": 0.6}, 1, "mirrors"),
        ({"bars": 0.7}, 2, "mirrors"),  # across the ends
        ({"bars": 0.9, "bar_inset": 0.0}, 2, "mirrors"),  # along the sides
        ({"end_posts": 0.3, "taper": 1.0, "ends": 0.3}, 2, "mirror"),  # a wedge
        ({"end_posts": 0.5, "end_spread": 1.0, "tip": 0.0}, 4, "mirrors"),  # notched ends: four prongs
    ],
)
def test_genes_say_where_tethers_stand(genes, tethers, symmetry):
    mould = decoded(vector(**genes)).cast.mould
    assert len(mould.tethers) == tethers
    assert symmetry_class(mould) == symmetry


def test_ends_may_be_broad_or_narrow_or_pointed():
    def width_at(x, outline):
        line = shapely.LineString([(x, -40), (x, 40)]).intersection(outline)
        return line.length

    for ends, wider in ((0.95, True), (0.3, False)):
        outline = decoded(vector(ends=ends, end_posts=0.3, middle=0.4, elongation=0.4)).cast.mould.outline
        assert (width_at(0.9 * outline.bounds[2], outline) > width_at(0.0, outline)) is wider
    pointed = decoded(vector(tip=1.0, end_posts=0.3)).cast.mould.outline
    assert width_at(0.98 * pointed.bounds[2], pointed) < 0.2 * width_at(0.0, pointed)


@pytest.mark.parametrize(
    ("genes", "changes"),
    [
        ({}, {}),  # no tether
        ({"rim_posts": 1.0, "post": 0.0}, {"tethers": [1, 2]}),
        ({"end_posts": 0.3}, {"process": {"neck": 50.0}}),
    ],
)
def test_what_cannot_be_made_is_a_violation(genes, changes):
    candidate = decoded(vector(**genes), **changes)
    assert candidate.cast is None
    assert candidate.violation > 0


def test_the_process_is_given_in_the_unit_of_the_mould():
    wanted = spec(mm_per_l0=0.5, process={"post": 1.0, "gap": 1.5, "wall": 1.0})
    assert wanted.least["post"] == 2.0
    assert wanted.least["gap"] == 3.0
    mould = decode(vector(end_posts=0.3, post=0.0), wanted, LAYERS, PIXELS).cast.mould
    assert [tether.radius for tether in mould.tethers] == [1.0, 1.0]
    assert mould.mm_per_l0 == 0.5


STRIP = CastMould(Mould(shapely.box(-20, -6, 20, 6), (Circle(-15, 0, 1), Circle(15, 0, 1))), LAYERS, PIXELS)


def strip(half_length=18.0, along=1.0):
    """Fields (8, y, x) of a rectangular tissue in which a share of the orientation lies along x."""
    x, y = np.meshgrid(pixel_centres(PIXELS), pixel_centres(PIXELS))
    density = 5 * density_threshold(LAYERS, PIXELS) * ((abs(x) < half_length) & (abs(y) < 5))
    fields = np.zeros((len(FIELDS), PIXELS, PIXELS))
    for name, share in (("density", 1.0), ("tension", 0.02), ("sxsx", along), ("sysy", 1 - along)):
        fields[FIELDS.index(name)] = share * density
    return fields


def value(name, fields, unit=1.0, **about):
    return measure(Measured(measure=name, **about), fields, View(STRIP, PIXELS), 1.0, unit)


def test_measures_of_a_uniform_strip():
    fields = strip()
    assert value("alignment", fields) == pytest.approx(1.0)
    assert value("alignment", fields, axis="short") == pytest.approx(-1.0)
    assert value("alignment", fields, axis=45.0) == pytest.approx(0.0, abs=1e-12)
    assert value("alignment", strip(along=0.75)) == pytest.approx(0.5)
    assert value("anisotropy", strip(along=0.25)) == pytest.approx(0.5)
    assert value("evenness", fields) == pytest.approx(1.0)
    assert value("tension", fields) == value("peak_tension", fields) == pytest.approx(0.02)
    assert value("length", fields) == pytest.approx(36, abs=1.0)
    assert value("width", fields) == pytest.approx(10, abs=1.0)
    assert value("area", fields, unit=0.1) == pytest.approx(3.6, rel=0.1)
    assert value("mould_length", fields, unit=0.1) == pytest.approx(4.0)
    assert value("mould_width", fields) == pytest.approx(12.0)
    assert value("tethers", fields) == 2


def test_measures_in_a_region_see_nothing_else():
    fields = strip()
    right = np.s_[:, PIXELS // 2 :]
    fields[:, *right] = strip(along=0.0)[:, *right]
    fields[1][right] *= 3
    assert value("alignment", fields) == pytest.approx(0.0)
    assert value("alignment", fields, region=(-1, -1, 0, 1)) == pytest.approx(1.0)
    assert value("alignment", fields, region=(0, -1, 1, 1)) == pytest.approx(-1.0)
    assert value("peak_tension", fields, region=(-1, -1, 0, 1)) == pytest.approx(0.02)
    assert value("peak_tension", fields) == pytest.approx(0.06)


def test_tethers_are_held_while_tissue_encloses_them():
    view = View(STRIP, PIXELS)
    assert all_held(strip(18.0), view, 1.0)
    assert not all_held(strip(13.0), view, 1.0)


def test_uneven_density_is_less_even():
    fields = strip()
    fields[:, :, PIXELS // 2 :] *= 3  # mean over cells of 1 and 3, a quarter and three quarters: 2.5
    assert value("evenness", fields) == pytest.approx(1 - np.sqrt(0.75) / 2.5)


def test_undominated_points():
    points = np.array([[0, 3], [1, 1], [3, 0], [2, 2], [1, 1]])
    assert undominated(points).tolist() == [0, 1, 2]
    assert undominated(np.empty((0, 2))).tolist() == []


def test_spread_takes_the_best_and_those_far_apart():
    points = np.array([[0, 10], [0.1, 9.9], [5, 5], [9.9, 0.1], [10, 0]])
    assert spread(points, 3).tolist() == [0, 2, 4]
    assert spread(points, 9).tolist() == [0, 1, 2, 3, 4]


def test_ranks_go_by_simulation_within_limits():
    import pandas as pd

    table = pd.DataFrame(
        {
            "simulated_alignment": [0.9, 0.8, 0.7, 0.95],
            "simulated_evenness": [0.5, 0.4, 0.6, 0.9],
            "simulated_meets": [True, True, True, False],
        }
    )
    ranks = ranked(table, spec())["rank"]
    assert ranks[:3].tolist() == [1, 2, 1]
    assert ranks.isna().tolist() == [False, False, False, True]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"objectives": []}, "objectives"),
        ({"objectives": [{"measure": "alignement"}]}, "measure is 'alignement'; known are alignment"),
        ({"objectives": [{"measure": "tension", "axis": "short"}]}, "tension has no axis"),
        ({"objectives": [{"measure": "area", "region": [0, 0, 1, 1]}]}, "area is of the whole tissue"),
        ({"objectives": [{"measure": "tension", "region": [1, 0, 0, 1]}]}, "give x0, y0, x1, y1"),
        ({"objectives": [{"measure": "held"}] * 2}, "an objective is given twice"),
        ({"constraints": [{"measure": "held"}]}, "has no limit; give at_least or at_most"),
        ({"constraints": [{"measure": "held", "at_least": 1, "at_most": 0}]}, "at_least 1.0 is above"),
        ({"tissue": "glia"}, "has no tissue 'glia'; did you mean"),
        ({"tissue": None}, "delta, kappa_nnn, kappa_nnnn missing"),
        ({"cells": {"kappa": 1}}, "cells has 'kappa'; known are delta"),
        ({"cells": {"delta": 0.99}}, "delta is 0.99; it must lie between"),
        ({"mould_cells": [900, 300]}, "an ascending range"),
        ({"process": {"wall": 0.5}}, "process.wall is 0.5; at least 1.2"),
        ({"process": {"post": 0.5}}, "process.post is 0.5; at least 0.8"),
        ({"search": {"population": 50, "evaluations": 20}}, "search.population is 50, above"),
        ({"finalist": 3}, "unknown key 'finalist'; did you mean 'finalists'?"),
    ],
)
def test_bad_specifications_are_named(changes, message):
    with pytest.raises(raptor.RaptorError, match="spec: ") as caught:
        spec(**changes)
    assert message in str(caught.value)


def test_a_specification_with_changes():
    wanted = with_changes(spec(), {"accuracy": "draft", "finalists": None}, {"seed": 3})
    assert (wanted.accuracy, wanted.finalists, wanted.search.seed) == ("draft", 2, 3)
    assert wanted.search.population == 16


def test_drawings_are_read_again_as_the_same_mould(tmp_path):
    mould = Mould(
        shapely.Polygon([(-20, -6), (18, -5), (20, 7), (-19, 6)]),
        (Circle(-12, 1, 1.5), shapely.box(10, -3, 11, 3)),
        mm_per_l0=0.5,
    )
    write_svg(tmp_path / "a.svg", mould)
    write_dxf(tmp_path / "a.dxf", mould)
    for name, scale in (("a.svg", None), ("a.dxf", 0.5)):
        again = read_mould(tmp_path / name, mm_per_l0=scale)
        assert again.mm_per_l0 == pytest.approx(0.5)
        moved = again.tethers[0].x - mould.tethers[0].x, again.tethers[0].y - mould.tethers[0].y
        outline = shapely.transform(again.outline, lambda xy, by=moved: xy - by)
        assert outline.symmetric_difference(mould.outline).area < 0.01
        assert [type(each) for each in again.tethers] == [Circle, PolygonTether]


@pytest.fixture(scope="module")
def surrogate():
    return raptor.load_surrogate()


def small(**changes):
    """A search of moulds in the range of the shipped surrogate, in seven layers."""
    return spec(mould_cells=[3000, 4500], **changes)


def test_a_search_improves_on_chance_and_repeats(surrogate):
    evaluator = Evaluator(small(), surrogate)
    found, again = search(evaluator), search(evaluator)
    assert np.array_equal(found.vectors, again.vectors)
    assert found.evaluations <= 96
    chance = evaluator.judge(np.random.default_rng(3).random((32, len(GENES))))
    good = (chance.violations <= 0).all(axis=1)
    best = chance.objectives[good].min(axis=0) if good.any() else np.zeros(2)
    assert (found.objectives.min(axis=0) < best).any()
    assert np.array_equal(undominated(found.objectives), np.arange(len(found.vectors)))
    firsts = [entry["alignment"] for entry in found.progress if not np.isnan(entry["alignment"])]
    assert firsts == sorted(firsts)


def test_the_search_sees_what_predict_sees(surrogate):
    evaluator = Evaluator(small(), surrogate)
    mould = raptor.read_mould("small_rectangle")
    cells = raptor.tissue("glial_1").fit
    values = evaluator.values([surrogate.cast(mould)], 8 * len(surrogate.members))
    prediction = raptor.predict(mould, cells)
    assert values["alignment"].mean() == pytest.approx(prediction.alignment, abs=1e-4)
    assert values["distance"][0, 0] == pytest.approx(prediction.distance)


def test_impossible_limits_are_said(surrogate):
    with pytest.raises(raptor.RaptorError, match="hardest was tension"):
        search(Evaluator(small(constraints=[{"measure": "tension", "at_most": -9.0}]), surrogate))


def test_finalists_are_simulated_beside_others_and_saved(surrogate, tmp_path):
    notes = []
    wanted = small(simulations=1, accuracy="draft", finalists=1, compare=["small_rectangle"], mm_per_l0=0.1)
    found = command.design(wanted, surrogate, notes.append)
    assert found.table["group"].tolist() == ["searched", "compared"]
    assert {"predicted_alignment", "predicted_alignment_std", "simulated_alignment"} <= set(found.table)
    assert found.best == "d01"
    assert any("front" in note for note in notes)
    folder = found.save(tmp_path / "found")
    assert {path.name for path in (folder / "moulds").iterdir()} == {"d01.geojson", "d01.svg", "d01.dxf"}
    assert read_spec(folder / "spec.yaml") == wanted
    again = read_mould(folder / "moulds" / "d01.geojson")
    assert again.outline.equals(found.moulds[0].outline)
    assert len(json.loads((folder / "designs.geojson").read_text())["features"]) == 2


def test_the_command_says_what_is_wrong_before_it_searches(tmp_path):
    path, file = tmp_path / "spec.yaml", tmp_path / "file"
    path.write_text("tissue: glial_1\nobjectives: [{measure: algnment}]\n")
    done = command_line("design", path, "--output", tmp_path / "found")
    assert done.returncode == 1
    assert "objectives.0: measure is 'algnment'; known are alignment" in done.stderr
    path.write_text("tissue: glial_1\nobjectives: [{measure: alignment}]\n")
    file.touch()
    done = command_line("design", path, "--output", file)
    assert f"{file} is a file; give the name of a folder" in done.stderr
    done = command_line("design", path, "--output", tmp_path / "found", "--evaluations", 3)
    assert "search.population is 100, above search.evaluations (3)" in done.stderr
    assert not (tmp_path / "found").exists()


def test_the_command_searches_and_draws(tmp_path, surrogate):
    path, folder = tmp_path / "spec.yaml", tmp_path / "found"
    path.write_text(json.dumps(SMALL | {"mould_cells": [3000, 4500]}))
    done = command_line("design", path, "--output", folder, "--evaluations", 32, "--quiet")
    assert done.returncode == 0, done.stderr
    assert "best alignment, predicted: searched" in done.stdout
    assert f"next: raptor simulate {folder / 'moulds' / 'd0'}" in done.stderr
    assert (folder / "front.png").read_bytes().startswith(b"\x89PNG")
    assert {path.name for path in folder.glob("*.csv")} == {"designs.csv", "front.csv", "progress.csv"}
