# The face of the package: what `import raptor` gives, and where each name lives.
from .condor.simulate import Tissue, simulate
from .core.errors import RaptorError
from .core.version import MODEL_VERSION, __version__
from .dataset.masks import rasterise
from .dataset.result import load_fields, save
from .fitting.command import fit
from .fitting.fitted import FittedTissue
from .imaging.command import measure
from .imaging.report import MeasuredPhotograph, MeasurementError
from .moulds.geometry import Circle, Mould
from .moulds.library.tissues import MeasuredTissue, tissue
from .moulds.reading import read_mould
from .optimisation.command import design
from .optimisation.designs import Designs
from .parameters import CellParameters, NetworkModel
from .plotting.front import plot
from .studies.curve import sweep
from .surrogate.command import load_surrogate, predict
from .surrogate.inference import Surrogate
from .surrogate.prediction import Prediction

__all__ = [
    "MODEL_VERSION",
    "CellParameters",
    "Circle",
    "Designs",
    "FittedTissue",
    "MeasuredPhotograph",
    "MeasuredTissue",
    "MeasurementError",
    "Mould",
    "NetworkModel",
    "Prediction",
    "RaptorError",
    "Surrogate",
    "Tissue",
    "__version__",
    "design",
    "fit",
    "load_fields",
    "load_surrogate",
    "measure",
    "plot",
    "predict",
    "rasterise",
    "read_mould",
    "save",
    "simulate",
    "sweep",
    "tissue",
]
