"""Versions of the package, of the model and of the files."""

from importlib.metadata import version

__version__ = version("raptor-tissue")

MODEL_VERSION = 3
"""Raised when a code change alters results; part of rule parameters and of every file.

3: a cell stands at least l0/4 inside every wall; ratios are over the tissue as cast, thin posts filled.
"""

STACK_FORMAT = 3
"""Raised when the layout of field stacks changes; they are then rebuilt from the same shards."""
