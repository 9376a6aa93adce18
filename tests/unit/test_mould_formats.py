"""The same mould as GeoJSON, SVG and PNG; and what is said of files that hold none."""

import re

import numpy as np
import pytest
import shapely
from PIL import Image

from raptor.core.errors import RaptorError
from raptor.frame import pixel_centres
from raptor.moulds import Circle, Mould, PolygonTether, read_mould
from raptor.moulds.cast import cast_sites
from raptor.moulds.library import MOULDS
from raptor.moulds.summary import summarise, symmetry_class
from tests.commands import executed, python_blocks
from tests.small import ROOT

pytestmark = pytest.mark.one_processor

DOG_BONE = ROOT / "tests" / "data" / "moulds"
FRAME = 'viewBox="-31.25 -31.25 62.5 62.5"'
BOX = '<rect id="outline" x="-20" y="-10" width="40" height="20"/>'


def points(polygon):
    return " ".join(f"{x!r},{-y!r}" for x, y in polygon.exterior.coords[:-1])


def as_svg(mould):
    shapes = [f'<polygon id="outline" points="{points(mould.outline)}"/>']
    for tether in mould.tethers:
        if isinstance(tether, Circle):
            shapes.append(f'<circle class="post" cx="{tether.x}" cy="{-tether.y}" r="{tether.radius}"/>')
        else:
            shapes.append(f'<polygon class="tether" points="{points(tether.polygon)}"/>')
    return svg("".join(shapes))


def svg(content, attributes=FRAME):
    return f'<svg xmlns="http://www.w3.org/2000/svg" {attributes}>{content}</svg>'


def paint(mould, pixels, dark=0):
    """A hard-edged picture (row, column, 3): a pixel has the colour of what its centre lies in."""
    x, y = np.meshgrid(pixel_centres(pixels), pixel_centres(pixels)[::-1])
    colours = np.full((pixels, pixels, 3), 255, np.uint8)
    colours[shapely.contains_xy(mould.outline, x, y)] = dark
    for tether in mould.tethers:
        colours[shapely.contains_xy(tether.polygon, x, y)] = (255, 0, 0)
    return colours


def save(path, colours):
    Image.fromarray(colours).save(path)
    return path


def apart(mould, other):
    """Area that only one of two moulds has, over the other's."""
    return mould.depression.symmetric_difference(other.depression).area / other.depression.area


@pytest.mark.parametrize("name", MOULDS)
def test_an_svg_holds_the_same_cells(name, tmp_path):
    mould = read_mould(name)
    path = tmp_path / f"{name}.svg"
    path.write_text(as_svg(mould))
    drawn = read_mould(path)
    assert np.array_equal(cast_sites(drawn, 7), cast_sites(mould, 7))
    assert apart(drawn, mould) < 1e-9
    assert [type(tether) for tether in drawn.tethers] == [type(tether) for tether in mould.tethers]
    assert drawn.name == name


@pytest.mark.parametrize("name", ["four_post_rectangle", "free_square", "i_shape", "glial_2", "corneal"])
@pytest.mark.parametrize(("pixels", "dark"), [(400, 0), (512, 90), (1000, 0)])
def test_a_png_holds_nearly_the_same_cells(name, pixels, dark, tmp_path):
    mould = read_mould(name)
    painted = read_mould(save(tmp_path / f"{name}.png", paint(mould, pixels, dark)))
    # Where a wall stands a quarter l0 from a row of cells, painting makes the row come or go.
    assert len(cast_sites(painted, 7)) == pytest.approx(len(cast_sites(mould, 7)), rel=0.025)
    # A wall lies within half a pixel and the simplification's half a pixel of where it was.
    walls = mould.outline.length + sum(tether.polygon.length for tether in mould.tethers)
    assert apart(painted, mould) < walls * 62.5 / pixels / mould.depression.area
    assert len(painted.tethers) == len(mould.tethers)
    assert symmetry_class(painted) == mould.symmetry


def test_the_drawings_of_the_documentation_are_one_mould():
    written = read_mould(DOG_BONE / "dog_bone.geojson")
    cells = cast_sites(written, 7)
    drawn = read_mould(DOG_BONE / "dog_bone.svg")
    assert np.array_equal(cast_sites(drawn, 7), cells)
    painted = read_mould(DOG_BONE / "dog_bone.png")
    assert len(cast_sites(painted, 7)) == pytest.approx(len(cells), rel=0.01)
    assert apart(painted, written) < 0.002
    assert all(isinstance(tether, Circle) for tether in painted.tethers)
    assert summarise(drawn) == summarise(written)


def test_the_page_on_moulds_shows_the_files_that_are_there(tmp_path, monkeypatch):
    page = (ROOT / "docs" / "moulds.md").read_text()
    for language, suffix in (("json", "geojson"), ("xml", "svg")):
        (block,) = re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL)
        assert block == (DOG_BONE / f"dog_bone.{suffix}").read_text()
    monkeypatch.chdir(tmp_path)
    (block,) = python_blocks(ROOT / "docs" / "moulds.md")
    executed(block)
    painted, kept = (
        np.asarray(Image.open(folder / "dog_bone.png"), dtype=int) for folder in (tmp_path, DOG_BONE)
    )
    assert np.abs(painted - kept).mean() < 0.5  # Pillow's versions may round edges differently


def test_up_is_up_in_every_format(tmp_path):
    """A post at the upper right stays there: SVG and pictures count downwards."""
    mould = Mould(shapely.box(-20, -10, 20, 10), (Circle(14.2, 5.3, 2.0),))
    (tmp_path / "a.svg").write_text(as_svg(mould))
    save(tmp_path / "a.png", paint(mould, 500))
    for path in (tmp_path / "a.svg", tmp_path / "a.png"):
        (post,) = read_mould(path).tethers
        assert (post.x, post.y, post.radius) == pytest.approx((14.2, 5.3, 2.0), abs=0.06)


def test_symmetry_is_found_from_the_shape():
    for mould in map(read_mould, MOULDS):
        assert symmetry_class(mould) == mould.symmetry
    post = Circle(5.0, 3.0, 1.0)
    box = shapely.box(-20, -10, 20, 10)
    assert symmetry_class(Mould(box, (post,))) == "none"
    assert symmetry_class(Mould(box, (post, Circle(-5.0, -3.0, 1.0)))) == "half_turn"
    assert symmetry_class(Mould(box, (post, Circle(-5.0, 3.0, 1.0)))) == "mirror"
    assert symmetry_class(Mould(shapely.box(-9, -9, 9, 9))) == "square"


def read_svg(tmp_path, content, attributes=FRAME, scale=None):
    path = tmp_path / "drawn.svg"
    path.write_text(svg(content, attributes))
    return read_mould(path, scale)


def test_shapes_are_told_apart_by_name_or_by_size(tmp_path):
    posts = '<circle cx="-12" cy="0" r="2"/><ellipse cx="12" cy="0" rx="2" ry="2"/>'
    by_size = read_svg(tmp_path, posts + '<rect x="-20" y="-10" width="40" height="20"/>')
    by_name = read_svg(tmp_path, f'<g id="posts">{posts}</g><g class="depression">{BOX}</g>')
    pieces = "M -20 -10 h 40 v 20 h -40 z M -14 -2 h 4 v 4 h -4 z M 10 -2 h 4 v 4 h -4 z"
    as_one_path = read_svg(tmp_path, f'<path id="outline" d="{pieces}"/>')
    label = 'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
    layer = f'<g inkscape:label="Tether posts">{posts}</g><g inkscape:label="Outline">{BOX}</g>'
    by_layer = read_svg(tmp_path, layer, f"{FRAME} {label}")
    expected = Mould(shapely.box(-20, -10, 20, 10), (Circle(-12, 0, 2), Circle(12, 0, 2)))
    for mould in (by_size, by_name, by_layer):
        assert apart(mould, expected) < 1e-9
    assert as_one_path.depression.area == pytest.approx(800 - 32)
    assert not as_one_path.depression.contains(shapely.Point(-12, 0))


def test_what_is_no_shape_does_not_count(tmp_path):
    rest = (
        '<line x1="-30" y1="-30" x2="30" y2="30"/><text x="0" y="0">notes</text>'
        '<path d="M -30 0 L 30 0"/><circle cx="25" cy="25" r="4" style="display:none"/>'
        '<defs><circle id="unused" r="9"/></defs>'
    )
    mould = read_svg(tmp_path, BOX + rest)
    assert mould.outline.equals(shapely.box(-20, -10, 20, 10))
    assert mould.tethers == ()


def test_transforms_and_curves(tmp_path):
    mould = read_svg(
        tmp_path,
        '<g transform="rotate(90) scale(2)"><rect id="outline" x="-10" y="-5" width="20" height="10" rx="2"/>'
        '<circle id="post" cx="5" cy="0" r="1"/></g>'
        '<g transform="scale(1, 0.5)"><circle id="tether" cx="0" cy="-20" r="4"/></g>',
    )
    assert np.allclose(mould.outline.bounds, (-10, -20, 10, 20), atol=0.01)
    assert mould.outline.area == pytest.approx(800 - (4 - np.pi) * 16, rel=1e-3)
    post, squeezed = mould.tethers
    assert (post.x, post.y, post.radius) == pytest.approx((0, -10, 2))
    assert isinstance(squeezed, PolygonTether)
    assert np.allclose(squeezed.polygon.bounds, (-4, 8, 4, 12), atol=0.01)


@pytest.mark.parametrize(
    ("attributes", "scale"),
    [
        ('viewBox="0 0 210 297" width="210mm" height="297mm"', 0.5),
        ('viewBox="0 0 210 297" width="210mm" height="297mm" data-l0="0.5"', None),
        ('data-l0="7"', 0.5),  # the option goes before the attribute
        ('width="100" height="100"', None),
        ('viewBox="20 0 62.5 62.5"', None),
    ],
)
def test_lengths_of_an_svg(tmp_path, attributes, scale):
    mould = read_svg(tmp_path, '<rect x="30" y="40" width="40" height="20"/>', attributes, scale)
    expected = {
        'width="100" height="100"': shapely.box(-26, -13, 26, 13),  # fitted
        'viewBox="20 0 62.5 62.5"': shapely.box(-21.25, -28.75, 18.75, -8.75),
    }.get(attributes, shapely.box(-10, -5, 10, 5))
    assert apart(mould, Mould(expected)) < 1e-9


def test_scale_of_a_geojson_and_of_a_png(tmp_path):
    half = read_mould(DOG_BONE / "dog_bone.geojson", 0.5)
    assert half.depression.area == pytest.approx(
        read_mould(DOG_BONE / "dog_bone.geojson").depression.area / 4
    )
    colours = np.full((100, 300, 3), 255, np.uint8)
    colours[20:60, 100:180] = 0
    wide = read_mould(save(tmp_path / "wide.png", colours))  # no square, so it is fitted
    assert np.allclose(wide.outline.bounds, (-26, -13, 26, 13), atol=0.4)
    assert wide.note.startswith("fitted to the frame at 0.65")
    scaled = read_mould(tmp_path / "wide.png", 0.25)
    assert np.allclose(scaled.outline.bounds, (-10, -5, 10, 5))
    with pytest.raises(RaptorError, match=r"x 40 l0 at 1 l0 per pixel.*scale of 0.7\d+ or less"):
        read_mould(tmp_path / "wide.png", 1.0)
    with pytest.raises(RaptorError, match="positive number of l0"):
        read_mould(tmp_path / "wide.png", -1.0)


def test_a_size_that_cannot_work_is_refused_with_one_that_can(tmp_path):
    tiny = '<rect x="0.1" y="0.1" width="0.3" height="0.3"/>'
    assert read_svg(tmp_path, tiny).outline.area == pytest.approx(52**2)
    assert read_svg(tmp_path, tiny, scale=100).outline.area == pytest.approx(900)
    for scale, message in (
        (0.3, r"0.09 x 0.09 l0 .* give a scale of 1.67 or more \(--scale 173 fits\)"),
        (300, r"90 x 90 l0 .* give a scale of 208 or less \(--scale 173 fits\)"),
    ):
        with pytest.raises(RaptorError, match=message):
            read_svg(tmp_path, tiny, scale=scale)


@pytest.mark.parametrize(
    ("content", "attributes", "message"),
    [
        ("", FRAME, "draws no outline"),
        ('<circle id="post" r="2"/>', FRAME, "draws no outline"),
        (
            BOX + BOX.replace("outline", "outline2").replace("40", "39"),
            FRAME,
            "2 shapes are called outline .'outline', 'outline2'",
        ),
        ('<polygon points="-5,-5 5,5 5,-5 -5,5"/>', FRAME, "not a simple polygon .*edges cross"),
        (BOX + '<circle id="post7" cx="25" r="2"/>', FRAME, "tether 'post7' reaches out of the depression"),
        (BOX + '<circle id="post7" r="0.1"/>', FRAME, "tether 'post7' is too thin"),
        (
            BOX + '<path id="post" d="M-20-10h20v20h-20zM0-10h20v20h-20z"/>',
            FRAME,
            "cover the depression",
        ),
        (BOX, 'data-l0="ten"', "data-l0 is 'ten'"),
        (BOX, 'data-l0="3"', "scale of 1.56 or less"),
        (BOX + '<path id="p" d="M 0 0 L 3 foo"/>', FRAME, "<path> 'p' cannot be read"),
        (BOX + '<path id="p" d="M 0 0 L 3 3 4"/>', FRAME, "<path> 'p' cannot be read"),
        (BOX + '<polygon id="p" points="0 0 1 1 2"/>', FRAME, "<polygon> 'p' cannot be read .*pairs"),
        (BOX + '<circle id="c" r="big"/>', FRAME, "<circle> 'c' cannot be read"),
    ],
)
def test_a_bad_svg_is_named(tmp_path, content, attributes, message):
    with pytest.raises(RaptorError, match=message) as caught:
        read_svg(tmp_path, content, attributes)
    assert "drawn.svg" in str(caught.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"", "is empty"), (b"hello", "is not SVG"), (svg(BOX).encode()[:-20], "is truncated"),
     (b"<html></html>", "its root is <html>"), (b"<svg xmlns='x'/>", "lacks the namespace"),
     (b"\x89PNG\r\n\x1a\n", "is not SVG")],
)  # fmt: skip
def test_a_file_that_is_no_svg(tmp_path, content, message):
    path = tmp_path / "bad.svg"
    path.write_bytes(content)
    with pytest.raises(RaptorError, match=message):
        read_mould(path)


WHITE, BLACK, RED, BLUE = (255, 255, 255), (0, 0, 0), (255, 0, 0), (0, 0, 255)


def picture(*patches, background=WHITE):
    """Colours (100, 100, 3) with patches (rows, columns, colour) painted one after another."""
    colours = np.full((100, 100, 3), background, np.uint8)
    for rows, columns, colour in patches:
        colours[slice(*rows), slice(*columns)] = colour
    return colours


BODY = ((20, 80), (20, 80), BLACK)


@pytest.mark.parametrize(
    ("colours", "message"),
    [
        (picture(), "shows no depression"),
        (picture(((20, 80), (20, 80), RED)), "shows no depression"),
        (picture(((20, 80), (20, 80), WHITE), background=BLACK), "dark all along its border"),
        (
            picture(((10, 40), (10, 40), BLACK), ((60, 90), (60, 90), BLACK)),
            r"shows 2 dark pieces .column \d4, row \d4 and",
        ),
        (picture(BODY, ((5, 15), (5, 15), RED)), "tether at column 10, row 10 reaches out of the depression"),
        (picture(BODY, ((40, 41), (50, 51), RED)), "tether at column 50, row 40 is too thin"),
        (picture(BODY, ((40, 50), (40, 50), BLUE)), "the colour #0000ff at column 40, row 40"),
    ],
)
def test_a_bad_png_is_named(tmp_path, colours, message):
    with pytest.raises(RaptorError, match=message) as caught:
        read_mould(save(tmp_path / "bad.png", colours))
    assert "bad.png" in str(caught.value)


def test_a_file_that_is_no_png(tmp_path):
    whole = (DOG_BONE / "dog_bone.png").read_bytes()
    path = tmp_path / "bad.png"
    for content in (b"hello", whole[:1000], whole[:20], svg(BOX).encode()):
        path.write_bytes(content)
        with pytest.raises(RaptorError, match=r"is no picture that can be read|is truncated"):
            read_mould(path)


@pytest.mark.parametrize("mode", ["1", "L", "P", "LA", "RGBA", "I;16"])
def test_pictures_of_every_mode(tmp_path, mode):
    grey = Image.fromarray(picture(BODY)[..., 0])
    if mode in ("LA", "RGBA"):  # transparent where it was white
        made = Image.new(mode, grey.size)
        made.putalpha(grey.point(lambda value: 255 - value))
    elif mode == "I;16":
        made = Image.fromarray(np.asarray(grey).astype(np.uint16) * 257)
    else:
        made = grey.convert(mode)
    made.save(tmp_path / "a.png")
    mould = read_mould(tmp_path / "a.png")
    assert np.allclose(mould.outline.bounds, (-18.75, -18.75, 18.75, 18.75), atol=0.3)


def test_white_spots_and_tethers_at_the_wall(tmp_path):
    spots = picture(BODY, ((40, 50), (30, 40), WHITE), ((20, 30), (50, 60), RED))
    mould = read_mould(save(tmp_path / "a.png", spots))
    assert len(mould.tethers) == 2
    assert mould.depression.area == pytest.approx((3600 - 200) * 0.625**2, rel=0.01)


def test_a_folder_does_not_hide_a_library_mould(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fibroblast").mkdir()
    assert read_mould("fibroblast").name == "fibroblast"


def test_other_suffixes_and_folders(tmp_path):
    path = tmp_path / "mould.step"
    with pytest.raises(RaptorError, match="does not exist"):
        read_mould(path)
    path.write_bytes(b"x")
    with pytest.raises(RaptorError, match=r"suffix '.step'; a mould is read from .geojson, .json, .svg"):
        read_mould(path)
    (tmp_path / "a.svg").mkdir()
    with pytest.raises(RaptorError, match="is a folder"):
        read_mould(tmp_path / "a.svg")
