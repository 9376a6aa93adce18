import json

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from raptor.core.errors import RaptorError
from raptor.moulds import Circle, Mould, PolygonTether, mould_image, read_mould, read_moulds, write_moulds
from raptor.moulds.library import MOULDS
from raptor.moulds.random_moulds import GROUPS, RandomMoulds
from raptor.symmetry import Element

pytestmark = pytest.mark.one_processor

RULES = RandomMoulds(cells=(500, 3000), tethers=(2, 16))


def write(path, geometry, **properties):
    feature = {"type": "Feature", "geometry": geometry, "properties": properties}
    path.write_text(json.dumps(feature))
    return path


def polygon(*corners):
    return {"type": "Polygon", "coordinates": [[list(c) for c in (*corners, corners[0])]]}


SQUARE = polygon((-5, -5), (5, -5), (5, 5), (-5, 5))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([None, *GROUPS]))
def test_random_moulds_keep_their_bounds_and_symmetry(seed, symmetry):
    mould = RULES.draw(np.random.default_rng(seed), 4, "m", symmetry)
    assert mould == RULES.draw(np.random.default_rng(seed), 4, "m", symmetry)
    assert symmetry in (None, mould.symmetry)
    assert mould.depression.geom_type == "Polygon"  # connected
    assert 500 <= 4 * mould.depression.area <= 3000
    assert 2 <= len(mould.tethers) <= 16
    assert max(map(abs, mould.outline.bounds)) <= 31.25 - 3.0
    assert any(  # the mirror may be that of the other axis
        all(looks_alike(mould, turn @ element @ turn.inverse) for element in GROUPS[mould.symmetry])
        for turn in (Element(0, False), Element(1, False))
    )


def looks_alike(mould, element):
    moved = mould.transformed(element.matrix)
    posts, moved_posts = ({(round(t.x, 9), round(t.y, 9)) for t in m.tethers} for m in (mould, moved))
    return moved.outline.symmetric_difference(mould.outline).area < 1e-6 and posts == moved_posts


def test_the_library_is_known_by_name_in_every_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert {"four_post_rectangle", "i_shape", "glial_1", "corneal"} <= set(MOULDS)
    for name in MOULDS:
        assert read_mould(name).name == name
    with pytest.raises(RaptorError, match="did you mean 'glial_1'"):
        read_mould("glial1")


def test_moulds_survive_writing_and_reading(tmp_path):
    moulds = [RULES.draw(np.random.default_rng(seed), 4, f"m{seed}") for seed in range(4)]
    write_moulds(tmp_path / "moulds.geojson", moulds)
    assert read_moulds(tmp_path / "moulds.geojson") == moulds


def test_a_mould_takes_plain_shapes_and_its_holes_are_tethers(tmp_path):
    bar, hole = shapely.box(-8, -8, 8, -6), shapely.box(-3, -3, 3, 3)
    mould = Mould(shapely.box(-12, -12, 12, 12).difference(hole), tethers=[Circle(0, 8, 1), bar])
    assert mould == Mould(mould.outline, (Circle(0, 8, 1), PolygonTether(bar), mould.tethers[2]))
    assert not mould.outline.interiors
    assert mould.tethers[2].polygon.equals(hole)
    geometry = json.loads(shapely.to_geojson(shapely.MultiPolygon([mould.depression])))
    assert read_mould(write(tmp_path / "m.geojson", geometry)).depression.equals(mould.depression)


@pytest.mark.parametrize(
    ("shapes", "message"),
    [
        (("a square",), "the outline is of type str; give one shapely Polygon"),
        ((shapely.MultiPolygon(),), "the outline is of type MultiPolygon"),
        ((shapely.box(0, 0, 9, 9), [(3, 3, 1)]), "a tether is of type tuple; give a Circle or"),
        ((shapely.box(0, 0, 9, 9), [shapely.Point(3, 3).buffer(2).difference(shapely.Point(3, 3).buffer(1))]),
         "tether 1 has a hole; fill it"),
    ],
)  # fmt: skip
def test_what_is_no_mould_is_named(shapes, message):
    with pytest.raises(RaptorError, match=message):
        Mould(*shapes)


def test_masks_are_disjoint_and_cover_the_areas():
    mould = Mould(shapely.box(-20, -10, 20, 10), (Circle(5, 0, 4), PolygonTether(shapely.box(-9, -6, -5, 6))))
    image = mould_image(mould, 256)
    assert not (image.depression & image.tethers).any()
    pixel = (62.5 / 256) ** 2
    assert image.depression.sum() * pixel == pytest.approx(mould.depression.area, rel=0.01)
    assert image.tethers.sum() * pixel == pytest.approx(np.pi * 16 + 48, rel=0.04)


def test_forbidden_depth_is_signed():
    mould = Mould(shapely.box(-5, -5, 5, 5), (Circle(0, 0, 1),))
    points = np.array([[6.0, 0], [0, 0], [3, 0], [0, -1.5]])
    assert mould.forbidden_depth(points) == pytest.approx([1, 1, -2, -0.5])


@pytest.mark.parametrize(
    ("geometry", "properties", "message"),
    [
        (polygon((-5, -5), (5, 5), (5, -5), (-5, 5)), {}, "not a simple polygon .*edges cross"),
        (polygon((-4e9, -5), (5, -5), (5, 5)), {}, "a coordinate is beyond 1e"),
        (polygon((0, 0), (0, 0), (0, 0)), {}, "is empty"),
        ({"type": "MultiPolygon", "coordinates": [[], []]}, {}, "in 2 pieces"),
        ({"type": "Point", "coordinates": [0, 0]}, {}, "a Polygon is expected"),
        ({"type": "Sphere", "coordinates": [0, 0]}, {}, "geometry is Sphere; a Polygon is expected"),
        (SQUARE, {"tethers": [{"x": 0, "y": 0, "radius": 8}]}, "reaches out of the depression"),
        (
            SQUARE,
            {"tethers": [{"polygon": [[-5, -5], [5, -5], [5, 5], [-5, 5]]}]},
            "cover the depression",
        ),
        (SQUARE, {"tethers": [{"x": 0, "y": 0, "radius": -1}]}, "must be positive"),
        (SQUARE, {"Tether": []}, "unknown property 'Tether'; did you mean 'tethers'"),
        (SQUARE, {"tethers": [{"x": 0, "r": 1}]}, 'must be {"x", "y", "radius"}'),
        (SQUARE, {"tethers": [{"polygon": [[0, 0], [1]]}]}, "not a list of"),
        (polygon((0, float("nan")), (5, -5), (5, 5)), {}, "finite|simple|empty"),
    ],
)
def test_a_bad_mould_is_named(tmp_path, geometry, properties, message):
    path = write(tmp_path / "bad.geojson", geometry, **properties)
    with pytest.raises(RaptorError, match=message) as caught:
        read_mould(path)
    assert "bad.geojson" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [("", "is empty"), ("{", "is not GeoJSON"), ("[]", "no GeoJSON type"), ("{}", "no GeoJSON type"),
     ('{"type": "FeatureCollection", "features": []}', "holds no mould")],
)  # fmt: skip
def test_a_bad_file_is_named(tmp_path, text, message):
    path = tmp_path / "bad.geojson"
    path.write_text(text)
    with pytest.raises(RaptorError, match=message):
        read_mould(path)


def test_a_missing_file_and_several_moulds_are_named(tmp_path):
    with pytest.raises(RaptorError, match="does not exist"):
        read_mould(tmp_path / "none.geojson")
    write_moulds(tmp_path / "two.geojson", [Mould(shapely.box(0, 0, 5, 5))] * 2)
    with pytest.raises(RaptorError, match="2 pieces"):
        read_mould(tmp_path / "two.geojson")


def test_impossible_bounds_of_random_moulds_are_named():
    rules = RandomMoulds(cells=(10, 12), tethers=(9, 9))
    with pytest.raises(RaptorError, match="widen the bounds"):
        rules.draw(np.random.default_rng(0), 4, "m")
