"""The typed configuration, assembled from the blocks that the package uses, and its reader."""

from raptor.config.configuration import Configuration
from raptor.config.reading import checked, load, parse

__all__ = ["Configuration", "checked", "load", "parse"]
