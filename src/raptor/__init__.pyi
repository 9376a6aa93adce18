# The face of the package: what `import raptor` gives, and where each name lives.
from .condor.simulate import Tissue, simulate
from .core.errors import RaptorError
from .core.version import MODEL_VERSION, __version__
from .moulds.geometry import Circle, Mould
from .moulds.library.tissues import MeasuredTissue, tissue
from .moulds.reading import read_mould
from .parameters import CellParameters, NetworkModel

__all__ = [
    "MODEL_VERSION",
    "CellParameters",
    "Circle",
    "MeasuredTissue",
    "Mould",
    "NetworkModel",
    "RaptorError",
    "Tissue",
    "__version__",
    "read_mould",
    "simulate",
    "tissue",
]
