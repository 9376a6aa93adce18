import base64

import pytest
import yaml

from raptor.config import parse
from raptor.core.errors import RaptorError
from raptor.report.html import NOTHING, number, percent, section, write_report

pytestmark = pytest.mark.one_processor


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.12345, 2, "0.12"), (0.99999, 3, "1.00"), (1234.5, 2, "1,200"), (3569, 2, "3,569"), (0, 2, "0"),
        (0.0, 2, "0"), (-2.345, 2, "-2.3"), (4.7e-7, 2, "4.7e-07"), (float("nan"), 2, NOTHING),
        (None, 2, NOTHING), ("surrogate", 2, "surrogate"),
    ],
)  # fmt: skip
def test_numbers_have_significant_digits(value, digits, text):
    assert number(value, digits) == text


def test_shares_are_in_per_cent():
    assert percent(0.954) == "95 %"
    assert percent(None) == percent(float("nan")) == NOTHING


def test_a_section_ends_at_the_next_heading():
    text = "# Card\n\n## Cost\nTwo\nhours.\n\n## Other\nMore.\n"
    assert section(text, "Cost") == "Two hours."
    assert section(text, "Other") == "More."
    assert section(text, "None") == ""


def test_a_report_holds_pictures_and_leaves_out_what_is_not_there(tmp_path):
    (tmp_path / "figures").mkdir()
    picture = tmp_path / "figures" / "one.png"
    picture.write_bytes(b"png")
    table = tmp_path / "numbers.csv"
    table.write_text("a,b\n1,<2>\n")
    template = tmp_path / "template.jinja"
    template.write_text(
        "{{ figures.one }} {% if files.get('none.csv') %}none{% endif %}{{ files['numbers.csv'][0].b }}"
    )
    write_report(tmp_path / "report.html", template, tmp_path, [picture, table, tmp_path / "shard.nc"])
    content = base64.b64encode(b"png").decode()
    assert (tmp_path / "report.html").read_text() == f"data:image/png;base64,{content} &lt;2&gt;"


def test_a_template_that_asks_for_what_is_not_there_is_a_clear_error(tmp_path):
    template = tmp_path / "template.jinja"
    template.write_text("{{ nothing }}")
    with pytest.raises(RaptorError, match="'nothing' is undefined"):
        write_report(tmp_path / "report.html", template, tmp_path, [])


def test_a_study_of_one_s_own_has_a_report_without_a_surrogate(pytestconfig, tmp_path):
    """Nothing but the configuration is there: every part of the text can be left out."""
    mine = {"moulds": "glial_1", "grid": {"delta": [0.5], "kappa_nnn": [0.5], "ratio": [0.5]}}
    content = {"name": "mine", "campaigns": {"mine": mine}, "models": {}, "tradeoff": {"cases": {}}}
    configuration = parse(content, "a test").model_dump(mode="json")
    (tmp_path / "configuration.yaml").write_text(yaml.safe_dump(configuration))
    template = pytestconfig.rootpath / "workflow" / "report" / "report.html.jinja"
    write_report(tmp_path / "report.html", template, tmp_path, [tmp_path / "configuration.yaml"])
    assert "</html>" in (tmp_path / "report.html").read_text()
