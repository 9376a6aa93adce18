"""Imports run one way: a room stands on the rooms above it, and no module on itself."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

pytestmark = pytest.mark.one_processor

SOURCE = Path(__file__).parents[2] / "src"
ROOMS = (
    "core", "frame", "symmetry", "parameters", "raster", "moulds", "fields", "condor", "dataset", "surrogate",
    "studies", "fitting", "imaging", "optimisation", "plotting", "report", "config", "face", "cli",
)  # fmt: skip
"""From the ground up; a module may import from its own room and from those before it. `face` is `raptor`."""


def modules():
    """Path of every module, and of the face's stub in place of the face, by dotted name."""
    paths = {path.with_suffix(""): path for suffix in ("py", "pyi") for path in SOURCE.rglob(f"*.{suffix}")}
    return {
        ".".join(stem.relative_to(SOURCE).parts).removesuffix(".__init__"): path
        for stem, path in paths.items()
    }


def imported(path, names):
    """Modules of the package that a file imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(filter(None, ("raptor" if node.level else "", node.module)))
            parts = {f"{base}.{alias.name}" for alias in node.names}
            found |= parts & names or {base}
    return found & names


def graph():
    paths = modules()
    return {name: imported(path, set(paths)) - {name} for name, path in paths.items()}


def room(name):
    return name.split(".")[1] if "." in name else "face"


def test_every_room_has_its_place():
    assert {room(name) for name in modules()} <= set(ROOMS)


def test_rooms_import_only_from_rooms_above():
    wrong = [
        f"{name} imports {other}"
        for name, others in graph().items()
        for other in sorted(others)
        if ROOMS.index(room(other)) > ROOMS.index(room(name))
    ]
    assert not wrong


def test_no_module_stands_on_itself():
    assert len(list(TopologicalSorter(graph()).static_order())) == len(modules())


def test_imports_in_functions_count():
    edges = graph()
    assert "raptor.core.errors" in edges["raptor.moulds.geometry"]
    assert "raptor.moulds.svg" in edges["raptor.moulds.reading"]
