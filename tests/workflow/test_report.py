"""The reports, opened in a real browser from a file, without a network."""

import html
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser

import pytest

from raptor.report.html import number

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
LOADS = {"src", "srcset", "poster", "data", "background"}
PROBE = """<script>
window.seen = [];
window.addEventListener("error", event => seen.push(String(event.message || event.target.src)), true);
window.addEventListener("load", () => {
  const images = [...document.images].map(image => [image.alt, image.naturalWidth]);
  const loaded = performance.getEntriesByType("resource").map(entry => entry.name.slice(0, 60));
  document.documentElement.dataset.probe = JSON.stringify({images, loaded, errors: seen});
});
</script>"""


class Resources(HTMLParser):
    """What a page loads, and where it links to."""

    def __init__(self, text):
        super().__init__()
        self.loaded, self.links, self.names = [], [], set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name in LOADS or (tag == "link" and name == "href"):
                self.loaded.append(value)
            if tag == "a" and name == "href":
                self.links.append(value)
            if name == "id":
                self.names.add(value)


def browse(page, folder, *arguments):
    """What a headless browser without a network makes of a page; its console goes to stderr."""
    if BROWSER is None:
        pytest.skip("no chromium found; apt-get install chromium")
    return subprocess.run(
        [
            BROWSER, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder / 'profile'}",
            "--host-resolver-rules=MAP * ~NOTFOUND", "--enable-logging=stderr", "--virtual-time-budget=10000",
            *arguments, page.resolve().as_uri(),
        ],
        capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip


def console(done):
    """What a page said on the browser's console."""
    return [line for line in done.stderr.splitlines() if ":CONSOLE" in line]


def probe(page, folder):
    """Images, resources and errors of a page, as the browser found them."""
    watched = folder / "watched.html"
    watched.write_text(page.read_text().replace("<head>", f"<head>{PROBE}", 1))
    done = browse(watched, folder, "--dump-dom")
    assert done.returncode == 0, done.stderr
    assert console(done) == []
    found = re.search(r'data-probe="([^"]*)"', done.stdout)
    assert found, done.stdout[:500]
    return json.loads(html.unescape(found[1]))


def test_every_figure_loads_without_a_network_or_an_error(results, tmp_path):
    seen = probe(results / "report.html", tmp_path)
    assert seen["errors"] == []
    assert all(width > 0 for _, width in seen["images"])
    assert len(seen["images"]) == len(list((results / "figures").glob("*.png")))
    assert all(name.startswith("data:") for name in seen["loaded"])


def test_the_report_is_seen(results, tmp_path):
    picture = tmp_path / "report.png"
    done = browse(results / "report.html", tmp_path, f"--screenshot={picture}", "--window-size=1100,1600")
    assert console(done) == []
    assert picture.stat().st_size > 20_000  # an empty page takes 6 kB


def test_the_technical_report_opens(results, tmp_path):
    done = browse(results / "workflow.html", tmp_path, "--dump-dom")
    assert not [line for line in console(done) if "tailwindcss" not in line]  # advice to its authors
    assert "How RAPTOR run" in done.stdout


def test_the_report_holds_all_that_it_shows(results):
    text = (results / "report.html").read_text()
    found = Resources(text)
    assert found.loaded
    assert all(value.startswith("data:") for value in found.loaded)
    assert "@import" not in text
    assert "url(" not in text
    assert "<script" not in text
    for link in found.links:
        assert link[1:] in found.names if link.startswith("#") else (results / link).is_file(), link


def test_the_report_reads_from_the_question_to_the_rebuilding(results):
    text = (results / "report.html").read_text()
    parts = ["question", "data", "surrogate", "limits", "contraction", "tissues", "tradeoff", "rebuild"]
    places = [text.index(f'<h2 id="{part}"') for part in parts]
    assert places == sorted(places)
    assert "Further figures" not in text
    numbers = [int(number) for number in re.findall(r"<b>Figure (\d+)\.", text)]
    assert numbers == list(range(1, len(numbers) + 1))


def test_captions_quote_the_run(results):
    text = (results / "report.html").read_text()
    (width, *_) = json.loads((results / "studies" / "sweep" / "differences.json").read_text())
    assert f"{number(abs(width['largest']['difference']))} (Four post rectangle, central width)" in text
    metrics = json.loads((results / "evaluation" / "film_unet" / "metrics.json").read_text())
    assert f"{100 * metrics['paper']['fields']['density']['vrmse']:.0f} %" in text
    assert not re.search(
        r"\b(nan|None)\b", re.sub(r"<pre>.*?</pre>|base64,[^\"]*", "", text, flags=re.DOTALL)
    )
