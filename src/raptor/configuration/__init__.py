"""The typed configuration: blocks, the whole, its reading, measured tissues."""

from raptor.configuration.reading import load, parse, require_castable
from raptor.configuration.sweep import Sweep
from raptor.configuration.tissues import Tissue, load_tissue, load_tissues, require_measured
from raptor.configuration.whole import Configuration, content_hash

__all__ = [
    "Configuration",
    "Sweep",
    "Tissue",
    "content_hash",
    "load",
    "load_tissue",
    "load_tissues",
    "parse",
    "require_castable",
    "require_measured",
]
