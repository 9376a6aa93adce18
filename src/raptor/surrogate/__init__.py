"""The surrogate: networks that predict the eight fields from a mould and three parameters."""
