# What the room gives, and where each name lives; `plot` is the front door.
from .campaigns import descriptors_figure, outcomes_figure
from .curve import curve_figure
from .designs import designs_figure, front_figure
from .drawing import (
    bulk_figure,
    design_figure,
    draw_mould,
    fields_figure,
    folding_figure,
    mould_figure,
    new_figure,
    require_picture,
    save,
    save_picture,
    show_field,
    tradeoff_figure,
)
from .evaluation import (
    active_learning_figure,
    calibration_figure,
    learning_figure,
    models_figure,
    regions_figure,
    training_figure,
    worst_figure,
)
from .fits import fit_figure, valley_figure
from .front import plot
from .sweep import contraction_figure, directors_figure, panels_figure

__all__ = [
    "active_learning_figure",
    "bulk_figure",
    "calibration_figure",
    "contraction_figure",
    "curve_figure",
    "descriptors_figure",
    "design_figure",
    "designs_figure",
    "directors_figure",
    "draw_mould",
    "fields_figure",
    "fit_figure",
    "folding_figure",
    "front_figure",
    "learning_figure",
    "models_figure",
    "mould_figure",
    "new_figure",
    "outcomes_figure",
    "panels_figure",
    "plot",
    "regions_figure",
    "require_picture",
    "save",
    "save_picture",
    "show_field",
    "tradeoff_figure",
    "training_figure",
    "valley_figure",
    "worst_figure",
]
