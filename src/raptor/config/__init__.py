"""The typed configuration: blocks, the whole, its reading."""

from raptor.config.configuration import Configuration, content_hash
from raptor.config.reading import load, parse, require_castable, require_measurable
from raptor.config.sweep import Sweep

__all__ = [
    "Configuration",
    "Sweep",
    "content_hash",
    "load",
    "parse",
    "require_castable",
    "require_measurable",
]
