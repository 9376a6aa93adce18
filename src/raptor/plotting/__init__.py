"""Figures. Each function draws onto a new figure from plain data; `save` writes it."""

from raptor.plotting.drawing import (
    bulk_figure,
    design_figure,
    draw_mould,
    fields_figure,
    fit_figure,
    folding_figure,
    new_figure,
    save,
    save_fields,
    show_field,
    tradeoff_figure,
)
from raptor.plotting.judging import (
    calibration_figure,
    models_figure,
    regions_figure,
    training_figure,
    worst_figure,
)

__all__ = [
    "bulk_figure",
    "calibration_figure",
    "design_figure",
    "draw_mould",
    "fields_figure",
    "fit_figure",
    "folding_figure",
    "models_figure",
    "new_figure",
    "regions_figure",
    "save",
    "save_fields",
    "show_field",
    "tradeoff_figure",
    "training_figure",
    "worst_figure",
]
