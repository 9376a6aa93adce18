"""Write docs/workflow.md and its picture from the rules: `workflow/env python workflow/reference.py`.

The page comes from the rules' docstrings and output files, the picture from Snakemake's rule graph. Without
Graphviz (`dot` and `tred`) the picture stays as it is.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "workflow.md"
PICTURE = ROOT / "docs" / "images" / "workflow.svg"
HEAD = """# The workflow

![Rules, coloured by file, and what each needs; without the rules of the report](images/workflow.svg)

```bash
workflow/env snakemake --cores all --dry-run  # what would run, and why
```

The Snakefile lists the parts. A file in `workflow/rules` wires files. A script in `workflow/scripts`, named
like its rule, makes one call into the package. A rule without files is a target:
`workflow/env snakemake TARGET --cores all`. Files are under `results/{name}`.

`workflow/env python workflow/reference.py` writes this page, and its picture where Graphviz is installed.
"""
COLOURS = ("#4477aa", "#66ccee", "#228833", "#ccbb44", "#ee6677", "#aa3377", "#bbbbbb", "#88ccaa", "#dd9944")
STYLE = """rankdir=LR; ranksep=0.35; nodesep=0.08;
node [shape=box, style="rounded,filled", fontname=Helvetica, fontsize=11, height=0.25, margin="0.08,0.02"];
edge [color="#999999", arrowsize=0.5];"""
HEAD_OF_RULE = re.compile(
    r"^ *(?:rule (?P<name>\w+)|use rule (?P<base>\w+) as (?P<copy>\w+) with|rule):\n", re.MULTILINE
)
REPORT = {"all", "report", "write_report", "record_configuration"}  # need every file


class Rule(NamedTuple):
    """A rule as the page shows it."""

    name: str
    text: str
    outputs: tuple[str, ...]


def rule_files() -> list[Path]:
    """Files of rules in the order in which the Snakefile includes them."""
    included = re.findall(
        r'^include: "(workflow/rules/\w+\.smk)"', (ROOT / "Snakefile").read_text(), re.MULTILINE
    )
    return [ROOT / path for path in included]


def read_rules(path: Path) -> tuple[str, list[Rule]]:
    """A file's docstring and its rules; a copy of a rule has that rule's docstring."""
    text = path.read_text()
    heads = list(HEAD_OF_RULE.finditer(text))
    rules: dict[str, Rule] = {}
    ends = [*(head.start() for head in heads[1:]), len(text)]
    for head, end in zip(heads, ends, strict=False):
        body = text[head.end() : end]
        named = re.search(r'name:\s+f"([^"]+)"', body)  # a rule made in a loop
        name = head["name"] or head["copy"] or re.sub(r"{\w+}", "NAME", named[1] if named else "")
        rules[name] = Rule(
            name, rules[head["base"]].text if head["base"] else _docstring(body), _outputs(body)
        )
    return _docstring(text), list(rules.values())


def _docstring(text: str) -> str:
    found = re.match(r'\s*"""(.*?)"""', text, re.DOTALL)
    return " ".join(found[1].split()) if found else ""


def _outputs(body: str) -> tuple[str, ...]:
    section = re.search(r"^( *)output:\n(.*?)(?=^\1\w|\Z)", body, re.DOTALL | re.MULTILINE)
    names = re.findall(r'"({[A-Z]+}[^"]+)"', section[2]) if section else []
    return tuple(_path(name) for name in names)


def _path(name: str) -> str:
    """A file below results/{name}: constants replaced by their values, wildcards in single braces."""
    constants = re.compile(r'^([A-Z]+) = f"(.+)"$', re.MULTILINE)
    values = dict(pair for path in rule_files() for pair in constants.findall(path.read_text()))
    while found := re.match(r"{([A-Z]+)}", name):
        name = values[found[1]] + name[found.end() :]
    return name.split("/", 2)[2].replace("{{", "{").replace("}}", "}")


def page() -> str:
    """The page as Markdown."""
    parts = [HEAD]
    for path in rule_files():
        title, rules = read_rules(path)
        if rules:
            rows = "\n".join(f"| `{r.name}` | {r.text} | {_cell(r.outputs)} |" for r in rules)
            head = "| rule | what it does | files |\n| --- | --- | --- |"
            parts.append(f"\n## {path.stem}\n\n{title}\n\n{head}\n{rows}\n")
    return "".join(parts)


def _cell(outputs: tuple[str, ...]) -> str:
    return ", ".join(f"`{name}`" for name in outputs)


def dot(graph: str) -> str:
    """Snakemake's rule graph without the report's rules, coloured by the file that holds a rule."""
    colour = {
        rule.name: COLOURS[number % len(COLOURS)]
        for number, path in enumerate(rule_files())
        for rule in read_rules(path)[1]
    }
    names = dict(re.findall(r'(\d+)\[label = "(\w+)', graph))
    kept = {number: name for number, name in names.items() if name not in REPORT}
    nodes = [f'{n} [label="{x}", fillcolor="{colour[x]}40", color="{colour[x]}"];' for n, x in kept.items()]
    edges = [f"{a} -> {b};" for a, b in re.findall(r"(\d+) -> (\d+)", graph) if a in kept and b in kept]
    return f"digraph rules {{\n{STYLE}\n" + "\n".join([*nodes, *edges]) + "\n}\n"


def draw() -> None:
    """Draw the rule graph of the default configuration."""
    command = [sys.executable, "-m", "snakemake", "--rulegraph", "dot", "--forceall"]
    graph = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    reduced = subprocess.run(["tred"], input=dot(graph), capture_output=True, text=True, check=True).stdout
    subprocess.run(["dot", "-Tsvg", "-o", str(PICTURE)], input=reduced, text=True, check=True)


if __name__ == "__main__":
    PAGE.write_text(page())
    if shutil.which("dot"):
        draw()
