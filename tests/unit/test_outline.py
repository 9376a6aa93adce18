"""Fits to a whole outline."""

import json

import numpy as np
import pytest
import shapely
from PIL import Image
from shapely.geometry import mapping

from raptor.core.errors import RaptorError
from raptor.fitting import (
    Outline,
    deviations,
    distances,
    minimise,
    outline_measure,
    outline_of,
    read_outline,
)
from raptor.fitting.targets import as_array
from raptor.frame import pixel_centres
from tests.stand_ins import TRUTH, ellipse

pytestmark = pytest.mark.one_processor


def test_distances_to_an_outline_are_signed_and_finer_than_a_pixel():
    x, y = np.meshgrid(pixel_centres(64), pixel_centres(64))
    circles = {radius: radius - np.hypot(x, y) for radius in (10.0, 10.3)}
    outline = outline_of(circles[10.0], 0.0)
    assert len(outline.points) == pytest.approx(128, abs=1)
    assert outline.length == pytest.approx(20 * np.pi, rel=0.01)
    assert distances(outline, circles[10.3], 0.0) == pytest.approx(0.3, abs=0.02)
    assert distances(outline_of(circles[10.3], 0.0), circles[10.0], 0.0) == pytest.approx(-0.3, abs=0.02)
    assert np.isnan(distances(outline, 0 * x, 1.0)).all()


def test_an_outline_determines_what_ratios_leave_open():
    outline = outline_of(ellipse([TRUTH])[0], 0.5)
    measure = outline_measure(ellipse, outline, 0.5)
    found = minimise(measure, lambda measured: measured, starts=16, seed=0)
    assert found.rank == 3
    assert as_array([found.parameters])[0] == pytest.approx(as_array([TRUTH])[0], abs=0.02)
    errors = deviations(measure, found, outline, 0.1)
    assert (errors < 0.1).all()
    flat = outline_measure(lambda parameters: ellipse([TRUTH] * len(parameters)), outline, 0.5)
    assert np.isinf(deviations(flat, found, outline, 0.1)).all()


def test_an_outline_is_read_from_a_picture(tmp_path):
    density = ellipse([TRUTH], 256)[0]
    wanted = outline_of(density, 0.5)
    for name, values in (("dark.png", 1 - density), ("bright.png", density)):
        Image.fromarray((255 * values[::-1]).astype(np.uint8)).save(tmp_path / name)
        found = read_outline(tmp_path / name)
        assert np.abs(distances(found, density, 0.5)).max() < 0.3
        assert found.length == pytest.approx(wanted.length, rel=0.02)
    for content, message in (
        (Image.new("L", (64, 32)), "crop it to the square frame"),
        (Image.new("L", (64, 64)), "has one colour"),
    ):
        content.save(tmp_path / "bad.png")
        with pytest.raises(RaptorError, match=message):
            read_outline(tmp_path / "bad.png")
    (tmp_path / "bad.png").write_bytes(b"no picture")
    with pytest.raises(RaptorError, match="no picture"):
        read_outline(tmp_path / "bad.png")


def test_an_outline_is_read_from_geojson(tmp_path):
    path, tissue = tmp_path / "tissue.geojson", shapely.Point(0, 0).buffer(10)
    path.write_text(json.dumps({"type": "Feature", "geometry": mapping(tissue), "properties": {}}))
    assert np.allclose(read_outline(path).points, Outline.along(tissue).points)
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [json.loads(path.read_text())]}))
    assert np.allclose(read_outline(path).points, Outline.along(tissue).points)
    for content, message in (
        ({"type": "Feature", "geometry": mapping(shapely.Point(0, 0))}, "holds no polygon"),
        ({"type": "Feature", "geometry": mapping(shapely.box(0, 0, 90, 9))}, "leaves the frame"),
        ([1], "is not GeoJSON of one tissue"),
        ({"type": "nothing"}, "is not GeoJSON of one tissue"),
    ):
        path.write_text(json.dumps(content))
        with pytest.raises(RaptorError, match=message):
            read_outline(path)


def test_an_outline_of_several_pieces_has_points_on_each():
    pieces = shapely.MultiPolygon([shapely.box(-5, -5, 0, 5), shapely.box(10, 10, 20, 20)])
    outline = Outline.along(pieces, 70)
    assert outline.length == pytest.approx(70)
    assert (outline.points[:, 0] > 9).sum() == pytest.approx(40, abs=1)
