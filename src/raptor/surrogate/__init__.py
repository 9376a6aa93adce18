"""The surrogate: pix2pix, from mould and parameters to the eight fields."""
