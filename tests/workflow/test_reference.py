"""docs/workflow.md and its picture agree with the rules."""

import re
import runpy

from tests.small import ROOT
from tests.workflow.place import snakemake

REFERENCE = runpy.run_path(str(ROOT / "workflow" / "reference.py"))
PICTURE = (ROOT / "docs" / "images" / "workflow.svg").read_text()


def listed():
    """Rules as Snakemake lists them, those made for each campaign under one name."""
    done = snakemake("--list", folder=ROOT)
    assert done.returncode == 0, done.stderr
    return {re.sub(r"^campaign_\w+", "campaign_NAME", line.split()[0]) for line in done.stdout.splitlines()}


def test_the_page_is_that_of_the_rules():
    again = "run `workflow/env python workflow/reference.py`"
    assert (ROOT / "docs" / "workflow.md").read_text() == REFERENCE["page"](), again


def test_every_rule_is_on_the_page_and_in_the_picture():
    rules = listed() - {"all"}
    page = (ROOT / "docs" / "workflow.md").read_text()
    assert set(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)) == rules
    targets = {rule for rule in rules if re.search(rf"^\| `{rule}` \|[^|]*\|  \|", page, re.MULTILINE)}
    shown = set(re.findall(r">(\w+)</text>", PICTURE))
    assert shown <= rules
    not_by_default = {"record_configuration", "fit_joint", "search_moulds", "publish", "designer"}
    assert rules - shown - targets <= not_by_default
