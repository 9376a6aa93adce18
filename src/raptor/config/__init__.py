"""The typed configuration: blocks, the whole, its reading, measured tissues."""

from raptor.config.configuration import Configuration, content_hash
from raptor.config.reading import load, parse, require_castable
from raptor.config.sweep import Sweep
from raptor.config.tissues import Tissue, load_tissue, load_tissues, require_measured

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
