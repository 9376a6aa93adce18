"""The surrogate: networks that lead from mould and parameters to the eight fields."""
