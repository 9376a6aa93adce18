"""The typed configuration: the blocks that the package works by, put together, and its reading."""

from raptor.config.configuration import Configuration
from raptor.config.reading import load, parse, require_castable, require_measurable

__all__ = ["Configuration", "load", "parse", "require_castable", "require_measurable"]
