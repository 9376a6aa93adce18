import json
from dataclasses import replace

import numpy as np
import pytest
import shapely
from skimage import io
from typer.testing import CliRunner

import raptor
from raptor.cli import app
from raptor.core.errors import RaptorError
from raptor.fields.shape import mould_ratios, outline_ratios
from raptor.frame import pixel_centres
from raptor.imaging import (
    Appearance,
    aligned,
    appearance_named,
    as_picture,
    from_landmarks,
    measure,
    parse_landmarks,
    read_picture,
    register,
)
from raptor.imaging.illumination import fit_light
from raptor.imaging.tissue import without_specks
from raptor.moulds import Circle, Mould, read_mould
from raptor.moulds.cast import CastMould
from raptor.plotting.overlay import overlay_figure
from tests.photograph import CASES, Camera, contracted, coverage, photograph

pytestmark = pytest.mark.one_processor

MOULD = read_mould("four_post_rectangle")
TISSUE = contracted(MOULD, 0.35, 0.08, 0.02, seed=1)
CAMERA = Camera(angle=17)


@pytest.fixture(scope="module")
def pixels():
    return photograph(MOULD, TISSUE, CAMERA)


def tethers_seen(camera):
    """Landmarks at the tethers' centres, as a user would write them."""
    centres = np.array([shapely.get_coordinates(t.polygon.centroid)[0] for t in MOULD.tethers])
    seen = camera.registration.to_pixels(centres)
    return [f"{column:.1f},{row:.1f}=tether {n}" for n, (column, row) in enumerate(seen, start=1)]


def measured(pixels, mould=MOULD, mirrored=False, **options):
    picture = as_picture(pixels, "picture")
    return measure(picture, mould, register(picture, mould, mirrored=mirrored), **options)


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.mould}-{case.camera.angle:g}")
def test_both_ratios_of_a_known_tissue_are_found_within_a_hundredth(case):
    mould, tissue, pixels = case.made()
    found = measured(pixels, mould, case.camera.mirrored)
    area, width = outline_ratios(tissue, mould)
    assert found.area_ratio == pytest.approx(area, abs=0.01)
    assert found.width_ratio == pytest.approx(width, abs=0.01)
    assert found.registration.scale == pytest.approx(case.camera.scale, rel=1e-3)
    looks_bright = case.camera.tissue > case.camera.floor
    assert found.tissue is (Appearance.BRIGHT if looks_bright else Appearance.DARK)


def test_a_drawing_without_noise_is_measured():
    drawn = replace(CAMERA, noise=0.0, blur=0.5, unevenness=0.0, texture=0.0)
    found = measured(photograph(MOULD, TISSUE, drawn))
    assert (found.area_ratio, found.width_ratio) == pytest.approx(outline_ratios(TISSUE, MOULD), abs=0.003)


def test_the_outline_lies_on_the_tissues_edge(pixels):
    found = measured(pixels)
    edge = found.outline.difference(MOULD.outline.exterior.buffer(0.5)).boundary
    for tether in MOULD.tethers:
        edge = edge.difference(tether.polygon.buffer(1.0))
    # The mould is its own image under a half turn, so that either of two outlines is right.
    distances = [
        shapely.distance(shapely.points(shapely.get_coordinates(edge) * side), TISSUE.boundary)
        for side in (1, -1)
    ]
    assert min(np.percentile(d, 95) for d in distances) < 0.25


def test_a_larger_picture_is_reduced_and_measures_alike():
    large = replace(CAMERA, size=(1300, 1700), scale=23.0)
    picture = as_picture(photograph(MOULD, TISSUE, large), "large")
    assert (picture.reduction, picture.values.shape) == (2, (650, 850))
    found = measure(picture, MOULD, register(picture, MOULD))
    assert found.area_ratio == pytest.approx(outline_ratios(TISSUE, MOULD)[0], abs=0.005)
    by_landmarks = register(picture, MOULD, tethers_seen(large))
    assert by_landmarks.scale * 2 == pytest.approx(23.0, rel=1e-3)
    assert by_landmarks.residual < 0.01


def test_landmarks_register_where_no_rim_is_seen():
    camera = replace(CAMERA, floor=1.0)
    picture = as_picture(photograph(MOULD, TISSUE, camera), "picture")
    with pytest.raises(RaptorError, match="does not have the shape of four_post_rectangle"):
        register(picture, MOULD)
    found = measure(picture, MOULD, register(picture, MOULD, tethers_seen(camera)))
    area, width = outline_ratios(TISSUE, MOULD)
    assert (found.area_ratio, found.width_ratio) == pytest.approx((area, width), abs=0.01)
    assert found.registration.method == "landmarks"


@pytest.mark.parametrize(
    ("landmarks", "message"),
    [
        (["1,2"], "is not of the form column,row=x,y"),
        (["1,2=tether 5", "3,4=0,0"], "names tether 5; four_post_rectangle has 4"),
        (["1,2=0,0"], "1 landmark given; give at least two"),
        (["1,2=0,0", "1,2=5,5"], "lie in one place"),
        (["100,100=-20,10", "500,100=20,10", "500,300=20,12"], "do not fit the mould: residual"),
    ],
)
def test_bad_landmarks(landmarks, message):
    with pytest.raises(RaptorError, match=message):
        from_landmarks(*parse_landmarks(landmarks, MOULD))


def test_landmarks_give_back_any_similarity():
    points = np.array([[-20.0, 5.0], [3.0, -9.0], [11.0, 8.0]])
    for mirrored in (False, True):
        known = replace(CAMERA, angle=-130, mirrored=mirrored).registration
        found = from_landmarks(known.to_pixels(points), points, mirrored)
        assert found.matrix == pytest.approx(known.matrix, abs=1e-8)
        assert found.angle == pytest.approx(-130)
        assert found.to_mould(found.to_pixels(points)) == pytest.approx(points)


def test_an_aligned_mask_measures_what_the_density_does():
    x, y = np.meshgrid(pixel_centres(256), pixel_centres(256))
    mould = Mould(shapely.box(-20, -10, 24, 10), (Circle(-15, 5, 2), Circle(16, -6, 2)))
    cast = CastMould(mould, 1, 256)
    density = np.where(cast.tethers, 0.0, np.exp(-((x / 14) ** 4) - ((y - 1) / (5 + 0.1 * x)) ** 4))
    picture = as_picture(density[::-1] > 0.3, "mask")  # the top of a picture is the highest y
    found = measure(picture, mould, aligned(picture.values.shape))
    area, width = mould_ratios(density, cast, 0.3)  # posts of 4 l0 are not thin
    assert found.area_ratio == pytest.approx(area, abs=0.005)
    assert found.width_ratio == pytest.approx(width, abs=0.01)
    shifted = as_picture(np.roll(density[::-1] > 0.3, 60, axis=0), "mask")
    with pytest.raises(RaptorError, match="lies outside the depression"):
        measure(shifted, mould, aligned(shifted.values.shape))
    with pytest.raises(RaptorError, match="drop --threshold"):
        measure(picture, mould, aligned(picture.values.shape), threshold=0.4)


def test_a_mask_of_a_turned_camera_is_measured_by_landmarks():
    mask = coverage(TISSUE, CAMERA) > 0.5
    for values, tissue in (
        (mask, Appearance.AUTO),
        (~mask, Appearance.DARK),
        (np.where(mask, 7, 3), Appearance.BRIGHT),
    ):
        picture = as_picture(values, "mask")
        assert picture.mask
        found = measure(picture, MOULD, register(picture, MOULD, tethers_seen(CAMERA)), tissue)
        area, width = outline_ratios(TISSUE, MOULD)
        assert (found.area_ratio, found.width_ratio) == pytest.approx((area, width), abs=0.003)


def test_the_threshold_moves_the_outline(pixels):
    picture = as_picture(pixels, "picture")
    seen = picture, MOULD, register(picture, MOULD)
    areas = [measure(*seen, threshold=level).area_ratio for level in (0.85, 1.0, 1.15)]
    assert areas == sorted(areas, reverse=True)
    assert areas[0] - areas[-1] < 0.03  # the edge is steep
    with pytest.raises(RaptorError, match="threshold is 9; brightness in the depression runs from"):
        measure(*seen, threshold=9)


def test_bright_and_dark_share_the_depression(pixels):
    bright, dark = (
        measured(pixels, tissue=tissue).outline.area for tissue in (Appearance.BRIGHT, Appearance.DARK)
    )
    assert bright + dark == pytest.approx(MOULD.depression.area, rel=0.01)
    with pytest.raises(RaptorError, match="allowed are bright, dark and auto"):
        appearance_named("pink")


def test_what_cannot_be_measured_is_refused(pixels):
    other = read_mould("glial_3")
    with pytest.raises(RaptorError, match="does not have the shape of glial_3"):
        measured(pixels, other)
    empty = shapely.box(0, 0, 0.1, 0.1)
    with pytest.raises(RaptorError, match="tissue and floor cannot be told apart"):
        measured(photograph(MOULD, empty, CAMERA))
    with pytest.raises(RaptorError, match=r"no mould is visible|does not have the shape"):
        measured(photograph(MOULD, empty, replace(CAMERA, floor=1.0, post=1.0)))
    with pytest.raises(RaptorError, match="the mould is too small in the image"):
        measured(photograph(MOULD, TISSUE, replace(CAMERA, scale=6.0)))
    with pytest.raises(RaptorError, match="does not lie in the image"):
        picture = as_picture(pixels, "picture")
        measure(picture, MOULD, replace(CAMERA, scale=30).registration)
    with pytest.raises(RaptorError, match="a mask shows no rim"):
        register(as_picture(pixels > 100, "mask"), MOULD)
    with pytest.raises(RaptorError, match="an aligned one is square"):
        register(as_picture(pixels, "picture"), MOULD, is_aligned=True)


@pytest.mark.parametrize("case", CASES[:3], ids=lambda case: f"{case.mould}, tissue {case.camera.tissue}")
def test_a_lamps_reflection_is_not_taken_for_tissue(case):
    """It is refused unless the threshold is given; the third of these was measured as all of the tissue."""
    mould, tissue, _ = case.made()
    shown = photograph(mould, tissue, replace(case.camera, glare=2.0))
    with pytest.raises(RaptorError, match=r"three surfaces.*reflection, turn the lamp"):
        measured(shown, mould)
    level = (case.camera.floor + case.camera.tissue) / 2
    look = Appearance.BRIGHT if case.camera.tissue > case.camera.floor else Appearance.DARK
    found = measured(shown, mould, tissue=look, threshold=level)
    assert found.area_ratio == pytest.approx(outline_ratios(tissue, mould)[0], abs=0.03)


@pytest.mark.parametrize("width", [0.4, 0.8])
def test_a_wall_seen_as_a_band_is_refused_and_measured_by_landmarks(width):
    walled = replace(CAMERA, wall=width)
    picture = as_picture(photograph(MOULD, TISSUE, walled), "picture")
    with pytest.raises(RaptorError, match="shows a second edge"):
        register(picture, MOULD)
    found = measure(picture, MOULD, register(picture, MOULD, tethers_seen(walled)))
    assert (found.area_ratio, found.width_ratio) == pytest.approx(outline_ratios(TISSUE, MOULD), abs=0.01)


DISC = Mould(
    shapely.Point(0, 0).buffer(20, quad_segs=32),
    (shapely.box(-12, -9, 12, -7), shapely.box(-12, 7, 12, 9), Circle(16.5, 0.0, 1.0)),
    name="disc",
)


@pytest.mark.parametrize("angle", [100, -80, 171])
@pytest.mark.parametrize("mould", [read_mould("hydrogel_construct"), DISC], ids=lambda mould: mould.name)
def test_where_the_outline_fits_in_several_directions_tethers_tell_which(mould, angle):
    camera = Camera(angle=angle, floor=0.55, tissue=0.2)
    tissue = contracted(mould, 0.3, 0.12)
    found = measured(photograph(mould, tissue, camera), mould)
    area, width = outline_ratios(tissue, mould)
    assert found.area_ratio == pytest.approx(area, abs=0.01)
    assert found.width_ratio == pytest.approx(width, abs=0.01)


def test_a_direction_that_no_tether_tells_is_refused():
    camera = Camera(angle=30, floor=0.55, tissue=0.2, post=0.55)
    pixels = photograph(DISC, shapely.Point(0, 0).buffer(5), camera)  # it covers none of the tethers
    with pytest.raises(RaptorError, match=r"fits in several directions.*give --landmark"):
        measured(pixels, DISC)


def test_the_mirror_image_of_a_mould_without_mirrors_needs_to_be_said():
    corners = [(-24, -12), (20, -12), (24, 2), (6, 13), (-10, 8), (-24, 12)]
    mould = Mould(shapely.Polygon(corners), (Circle(-18, -6, 1.5), Circle(15, -6, 1.5)), name="skew")
    tissue = contracted(mould, 0.3, 0.1)
    pixels = photograph(mould, tissue, replace(CAMERA, mirrored=True))
    with pytest.raises(RaptorError, match="--mirrored"):
        measured(pixels, mould)
    found = measured(pixels, mould, mirrored=True)
    assert found.area_ratio == pytest.approx(outline_ratios(tissue, mould)[0], abs=0.01)
    assert found.registration.angle == pytest.approx(CAMERA.angle, abs=0.1)


@pytest.mark.parametrize("degree", [1, 3])
def test_the_light_of_two_surfaces_is_found(degree):
    row, column = np.meshgrid(np.linspace(-1, 1, 60), np.linspace(-1, 1, 80), indexing="ij")
    light = 0.4 * column - 0.3 * row if degree == 1 else 0.5 * column**3 - 0.2 * row * column**2
    labels = (np.hypot(row, column) < 0.5).astype(np.int8)
    found, levels = fit_light(light + np.array([0.1, 0.8])[labels], labels, 3)
    assert np.ptp(found - light) < 1e-9
    assert levels[1] - levels[0] == pytest.approx(0.7)


def test_specks_are_left_out_and_small_holes_filled():
    holed = (
        shapely.box(0, 0, 10, 10).difference(shapely.box(2, 2, 2.5, 2.5)).difference(shapely.box(4, 4, 7, 7))
    )
    cleaned = without_specks(shapely.union_all([holed, shapely.box(20, 0, 20.5, 0.5)]), 1.0)
    assert cleaned.area == pytest.approx(100 - 9)


def test_ratios_of_an_outline():
    mould = Mould(shapely.box(-20, -10, 20, 10), (Circle(0, 0, 2),))
    tissue = shapely.box(-15, -4, 15, 4).intersection(mould.depression)
    area, width = outline_ratios(tissue, mould)
    assert area == pytest.approx(tissue.area / (800 - 4 * np.pi), rel=1e-3)
    assert width == pytest.approx((8 - 4) / (20 - 4))


def test_pictures_that_cannot_be_read(tmp_path):
    text = tmp_path / "text.png"
    text.write_text("no picture")
    tiny, flat, stack = (tmp_path / f"{name}.tif" for name in ("tiny", "flat", "stack"))
    io.imsave(tiny, np.arange(64, dtype=np.uint8).reshape(8, 8), check_contrast=False)
    io.imsave(flat, np.full((64, 64), 9, np.uint8), check_contrast=False)
    io.imsave(stack, np.zeros((5, 64, 64), np.uint8), check_contrast=False)
    for path, message in (
        (tmp_path / "none.png", "none.png does not exist"),
        (text, "is no picture that can be read: its content looks like none that is known"),
        (tiny, "is 8 x 8 pixels; at least 32 are needed"),
        (flat, "has the same value everywhere"),
        (stack, "holds 5 pages .time points, slices or channels.; give --page 1 to 5"),
    ):
        with pytest.raises(RaptorError, match=message):
            read_picture(path)


@pytest.mark.parametrize("layers", ["grey", "grey and alpha", "rgb", "rgba", "16 bits"])
def test_kinds_of_files_are_read_alike(pixels, layers, tmp_path):
    opaque = np.full_like(pixels, 255)
    arrays = {
        "grey": pixels,
        "grey and alpha": np.dstack([pixels, opaque]),
        "rgb": np.dstack([pixels] * 3),
        "rgba": np.dstack([pixels] * 3 + [opaque]),
        "16 bits": pixels.astype(np.uint16) * 257,
    }
    io.imsave(tmp_path / "picture.png", arrays[layers], check_contrast=False)
    values = read_picture(tmp_path / "picture.png").values
    assert np.allclose(values, pixels / pixels.max(), atol=1e-6)


def test_the_overlay_shows_ratios_and_threshold(pixels):
    picture = as_picture(pixels, "picture")
    found = measure(picture, MOULD, register(picture, MOULD))
    figure = overlay_figure(picture, MOULD, found)
    assert f"{found.area_ratio:.3f}" in figure.axes[0].get_title()
    assert any(
        f"{found.threshold:.3g}" in text.get_text() for text in figure.axes[1].get_legend().get_texts()
    )


def test_the_command_writes_what_it_measures(pixels, tmp_path):
    image, overlay, outline = (tmp_path / name for name in ("photo.png", "overlay.png", "outline.geojson"))
    io.imsave(image, pixels, check_contrast=False)
    arguments = ["measure", str(image), "--mould", "four_post_rectangle"]
    run = CliRunner().invoke(
        app, [*arguments, "--json", "--overlay", str(overlay), "--outline", str(outline)]
    )
    assert run.exit_code == 0, run.output
    found = json.loads(run.stdout)
    area, width = outline_ratios(TISSUE, MOULD)
    assert (found["area_ratio"], found["width_ratio"]) == pytest.approx((area, width), abs=0.01)
    assert found["pixels_per_l0"] == pytest.approx(CAMERA.scale, rel=1e-3)
    feature = json.loads(outline.read_text())
    assert feature["properties"] == found
    shape = shapely.geometry.shape(feature["geometry"])
    assert outline_ratios(shape, MOULD) == pytest.approx((found["area_ratio"], found["width_ratio"]))
    assert overlay.stat().st_size > 10_000
    spoken = CliRunner().invoke(app, arguments)
    assert f"A/A0 {found['area_ratio']:.3f}, w/w0 {found['width_ratio']:.3f}; bright tissue" in spoken.stdout
    bad = CliRunner().invoke(app, [*arguments, "--overlay", str(tmp_path / "none" / "x.png")])
    assert "does not exist; create it" in str(bad.exception)
    assert raptor.measure(pixels, "four_post_rectangle").numbers == found
