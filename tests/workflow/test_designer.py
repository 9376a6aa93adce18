"""The designer's page, opened in a real browser from a file, without a network."""

import gzip
import json
import shutil
import subprocess
from dataclasses import asdict

import pytest

import raptor
from raptor.moulds import read_mould
from raptor.moulds.library import MOULDS
from tests import commands
from tests.browser import Browser
from tests.small import ROOT

pytestmark = pytest.mark.one_processor

CELLS = raptor.CellParameters(0.55, 0.5, 0.2)
BUILT = ROOT / "src" / "raptor" / "report" / "designer"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    pytest.importorskip("onnxscript")
    path = tmp_path_factory.mktemp("designer") / "designer.html"
    assert commands.raptor("designer", "--output", path).returncode == 0
    return path


@pytest.fixture(scope="module")
def browser(page, tmp_path_factory):
    with Browser(tmp_path_factory.mktemp("profile")) as opened:
        opened.open(page)
        opened.wait("window.raptor && raptor.numbers", 300)
        yield opened


def shown(browser):
    """The numbers on the page, once the whole ensemble has answered for what is drawn."""
    return json.loads(browser.wait("raptor.numbers && JSON.stringify(raptor.numbers)", 120))


def start(browser, mould):
    """The numbers of a mould of the library with `CELLS`."""
    browser.value(f"raptor.adopt({{cells: {json.dumps(asdict(CELLS))}}})")
    browser.value(f"raptor.preset('{mould}')")
    return shown(browser)


def choose(browser, name, value):
    """Choose in a list of the page, as a user does."""
    there = f"document.getElementById('{name}')"
    browser.value(f"{there}.value = '{value}'")
    browser.value(f"{there}.dispatchEvent(new Event('change', {{bubbles: true}}))")


def assert_same(numbers, prediction):
    """Whether the page says what `raptor predict` says."""
    assert numbers["cells"] == prediction.cast.n_cells
    assert numbers["ratios"] == pytest.approx(prediction.ratios, abs=1e-3)
    assert numbers["bands"] == pytest.approx(prediction.measure_bands.half[-1], abs=1e-3)
    assert numbers["alignment"] == pytest.approx(prediction.alignment, abs=1e-3)
    assert numbers["anisotropy"] == pytest.approx(prediction.anisotropy, abs=1e-3)
    assert numbers["distance"] == pytest.approx(prediction.distance, abs=1e-3)
    assert numbers["disagreement"] == pytest.approx(prediction.disagreement, abs=1e-3)
    assert numbers["held"] == [None if share != share else share for share in prediction.held]
    assert numbers["unusual"] == prediction.unusual


def test_it_opens_without_a_network_or_an_error(page, browser):
    assert browser.said == []
    loaded = browser.value("performance.getEntriesByType('resource').map(entry => entry.name)")
    assert all(name.startswith(("data:", "blob:")) for name in loaded)
    assert page.stat().st_size < 20e6
    assert browser.value("document.querySelectorAll('svg .corner').length") == 4


def test_numbers_equal_those_of_the_command(browser):
    for name in list(MOULDS)[::2]:
        assert_same(start(browser, name), raptor.predict(name, CELLS))
    assert browser.said == []


def test_a_dragged_post_changes_the_numbers_and_an_exported_mould_keeps_them(browser, tmp_path):
    before = start(browser, "four_post_rectangle")
    post = browser.value("raptor.design.mould.tethers[0]")
    x, y = post["x"], post["y"]
    places = [browser.value(f"raptor.toScreen({x * share}, {y * share})") for share in (1, 0.6)]
    browser.drag(*places)
    after = shown(browser)
    assert after["ratios"] != pytest.approx(before["ratios"], abs=2e-3)
    assert browser.value("raptor.times.drags.length") > 0
    moved = browser.value("raptor.design.mould.tethers[0]")
    assert (moved["x"], moved["y"]) == pytest.approx((0.6 * x, 0.6 * y), abs=0.3)
    files = browser.value("raptor.files()")
    for suffix in ("geojson", "svg"):
        path = tmp_path / f"mine.{suffix}"
        path.write_text(files[suffix])
        assert_same(after, raptor.predict(read_mould(path), CELLS))
    drawn = tmp_path / "mine.dxf"
    drawn.write_text(files["dxf"])
    again = raptor.read_mould(drawn, scale=1)
    assert again.depression.area == pytest.approx(read_mould(tmp_path / "mine.svg").depression.area, rel=1e-3)
    browser.value(f"raptor.open({json.dumps(files['geojson'])}, 'mine.geojson')")
    assert shown(browser)["ratios"] == pytest.approx(after["ratios"], abs=1e-6)


def test_symmetry_undo_and_what_cannot_be_cast(browser):
    start(browser, "four_post_rectangle")
    browser.value("document.getElementById('symmetry').value = 'both'")
    browser.value("document.getElementById('symmetry').dispatchEvent(new Event('change'))")
    drawn = browser.value("raptor.design.mould")
    x, y = drawn["outline"][0]
    browser.drag(*(browser.value(f"raptor.toScreen({x * share}, {y * share})") for share in (1, 0.9)))
    # All corners have moved, and alike.
    browser.wait(
        "(outline => new Set(outline.map(point => point.map(Math.abs).join())).size == 1 && "
        f"Math.abs(outline[0][0]) < {abs(x)} - 0.1)(raptor.design.mould.outline)"
    )
    browser.value("document.getElementById('undo').click()")
    assert browser.value("raptor.design.mould") == drawn
    browser.value("raptor.adopt({mould: {outline: [[-9, -9], [9, 9], [9, -9], [-9, 9]], tethers: []}})")
    assert "cross" in browser.value("raptor.trouble")
    assert browser.value("raptor.numbers") is None
    assert browser.said == []


def test_ten_actions_by_mouse_and_keyboard_change_what_they_say(browser):
    start(browser, "four_post_rectangle")
    tethers = "raptor.design.mould.tethers"
    browser.click("post")  # 1
    assert browser.value(f"{tethers}.length") == 5
    browser.click("bar")  # 2
    assert browser.value(f"{tethers}.length") == 6
    before = browser.value(tethers)
    browser.key("ArrowRight")  # 3: the new bar is selected
    assert browser.value(tethers) != before
    browser.key("Delete")  # 4
    assert browser.value(f"{tethers}.length") == 5
    browser.key("z", code="KeyZ", modifiers=2)  # 5
    assert browser.value(f"{tethers}.length") == 6
    browser.key("z", code="KeyZ", modifiers=2 + 8)  # 6
    assert browser.value(f"{tethers}.length") == 5
    browser.click("keep")  # 7
    kept = shown(browser)
    choose(browser, "tissue", "corneal")  # 8
    after = shown(browser)
    assert after["ratios"][0] < kept["ratios"][0] - 0.1  # corneal cells contract more
    choose(browser, "field", "tension")  # 9
    corner = browser.value("raptor.design.mould.outline[0]")
    browser.drag(
        *(browser.value(f"raptor.toScreen({corner[0] * s}, {corner[1] * s})") for s in (1, 0.95))
    )  # 10
    assert shown(browser)["ratios"] != after["ratios"]
    assert browser.said == []


def test_a_finger_moves_a_post_on_a_small_screen(browser):
    browser.resize(390, 844, mobile=True)
    start(browser, "four_post_rectangle")
    post = browser.value("raptor.design.mould.tethers[0]")
    places = [browser.value(f"raptor.toScreen({post['x'] * s}, {post['y'] * s})") for s in (1, 0.7)]
    browser.touch(*places)
    moved = browser.value("raptor.design.mould.tethers[0]")
    assert (moved["x"], moved["y"]) == pytest.approx((0.7 * post["x"], 0.7 * post["y"]), abs=0.5)
    assert browser.value("document.documentElement.scrollWidth <= innerWidth")
    assert browser.said == []
    browser.resize(1280, 800)


def test_a_rebuild_gives_the_same_page(tmp_path):
    if not shutil.which("node") or not (ROOT / "designer" / "node_modules").is_dir():
        pytest.skip("give `npm ci` in designer/ (Node 20 or newer)")
    subprocess.run(["node", "build.mjs", tmp_path], cwd=ROOT / "designer", check=True)
    assert (tmp_path / "page.html").read_bytes() == (BUILT / "page.html").read_bytes()
    engines = [gzip.decompress((folder / "engine.wasm.gz").read_bytes()) for folder in (tmp_path, BUILT)]
    assert engines[0] == engines[1]
    assert sum(file.stat().st_size for file in BUILT.iterdir() if file.is_file()) < 6e6
