"""The typed configuration, assembled from the blocks that the package uses, and its reader."""

from raptor.config.configuration import Configuration
from raptor.config.reading import load, parse, require_castable, require_measurable

__all__ = ["Configuration", "load", "parse", "require_castable", "require_measurable"]
