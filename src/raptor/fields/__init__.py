"""From cells to images: rasterised fields, resampling, the measures of a tissue's shape, errors of fields."""
