"""Fits to synthetic photographs of simulated tissues, whose parameters are known.

`python -m tests.photographed_fits FOLDER COUNT` writes photographs, fits and pictures, and prints a table:
parameters and ratios as simulated, and what `raptor.fit` finds from the photograph alone.
"""

import sys
from pathlib import Path
from time import perf_counter

import numpy as np
import shapely
from skimage import io

import raptor
from raptor.fitting.outline import tissue_above
from raptor.fitting.targets import parameters_at
from tests.photograph import BLACK, BRIGHT_FLOOR, DARK_FLOOR, SQUARE, WHITE, Camera, photograph

MOULDS = ("four_post_rectangle", "glial_1", "small_rectangle", "glial_3", "reference_rectangle", "i_shape")
LOOKS = (DARK_FLOOR, BRIGHT_FLOOR, BLACK, WHITE)
SEED = 1000  # of simulations; fits use 0


def made(number):
    """Mould, simulated tissue and photograph of a number, with parameters drawn from the paper's region."""
    rng = np.random.default_rng(number)
    mould = raptor.read_mould(MOULDS[number % len(MOULDS)])
    unit = rng.random(3) * (0.7, 1, 1)  # above 0.68 tissues leave their posts
    tissue = raptor.simulate(mould, parameters_at(unit), seed=SEED + number)
    fields = tissue.fields()
    threshold = fields.attrs["threshold"]
    outline, cast = (
        tissue_above(density - threshold, mould.name)
        for density in (fields["density"].to_numpy(), tissue.cast_mould.density)
    )
    # A gel fills its mould, a lattice only to within up to half a spacing; the gel beyond it contracts too.
    whole = shapely.union_all([shapely.Polygon(part.exterior) for part in shapely.get_parts(cast)])
    gap = (mould.outline.area - whole.area) / mould.outline.length
    outline = outline.buffer(gap * np.sqrt(tissue.area_ratio)).intersection(mould.depression)
    look = LOOKS[number % len(LOOKS)]
    camera = Camera(SQUARE, 10, rng.uniform(-180, 180), noise=rng.uniform(0.03, 0.05), unevenness=0.6, **look)
    return mould, tissue, photograph(mould, outline, camera, number)


def main(folder, count):
    """Print one row a photograph, with the share of Deltas in their intervals."""
    folder.mkdir(parents=True, exist_ok=True)
    inside = 0
    for number in range(count):
        mould, tissue, pixels = made(number)
        stem = folder / f"{number:02d}_{mould.name}"
        io.imsave(stem.with_suffix(".png"), pixels, check_contrast=False)
        started = perf_counter()
        try:
            photo = raptor.measure(stem.with_suffix(".png"), mould)
        except raptor.MeasurementError as refused:
            sys.stdout.write(
                f"| {number} {mould.name} | {tissue.parameters.delta:.3f} | refused: {refused} |\n"
            )
            continue
        fit = raptor.fit(mould, photo.area_ratio, photo.width_ratio)
        seconds = perf_counter() - started
        raptor.plot(fit, photograph=photo).savefig(folder / f"{stem.name}_fit.png")
        low, high = fit.intervals["delta"]
        inside += low <= tissue.parameters.delta <= high
        sys.stdout.write(
            f"| {number} {mould.name} | {tissue.parameters.delta:.3f} | {fit.parameters.delta:.3f} "
            f"| {low:.3f} to {high:.3f} | {photo.area_ratio - tissue.area_ratio:+.4f} "
            f"| {photo.width_ratio - tissue.width_ratio:+.4f} | {fit.area_ratio - tissue.area_ratio:+.4f} "
            f"| {fit.width_ratio - tissue.width_ratio:+.4f} | {fit.simulations} | {seconds:.0f} |\n"
        )
        sys.stdout.flush()
    sys.stdout.write(f"Delta within its interval: {inside} of {count}\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
