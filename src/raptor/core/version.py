"""Versions of the package, of the model and of the files."""

from importlib.metadata import version

__version__ = version("raptor-tissue")

MODEL_VERSION = 2
"""Raised whenever a change of code changes results: it travels in rule parameters and in files."""

STACK_FORMAT = 2
"""Raised whenever the layout of field stacks changes: they are then built again, from the same shards."""
