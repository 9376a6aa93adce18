"""raptor rasterise: the masks of a mould, as networks see them."""

from pathlib import Path
from typing import Annotated

import typer

import raptor
from raptor.cli import options as opt


def rasterise(
    mould: opt.Mould,
    output: Annotated[Path, typer.Option(help="netCDF file or PNG picture to write")],
    pixels: Annotated[int, typer.Option(min=16, max=4096, help="along a side of the frame of 62.5 l0")] = 256,
    scale: opt.Scale = None,
    mm_per_l0: opt.MmPerL0 = None,
    page: opt.Page = None,
) -> None:
    """Write the masks of a mould's depression and tethers, which the surrogate's networks see.

    netCDF has both (y, x), 1 where the centre of a pixel lies inside, and the mould. A PNG picture shows the
    depression grey and tethers red on white, one pixel each, and can be read as a mould again.

    Example:
      raptor rasterise mould.svg --output masks.nc
      raptor rasterise mould.svg --pixels 512 --output masks.png
    """
    from raptor.dataset.masks import require_masks_name, write_masks

    require_masks_name(output)
    opt.require_writable(output, mould, kind="masks")
    masks = raptor.rasterise(opt.read_mould(mould, scale, mm_per_l0, page), pixels)
    write_masks(masks, output)
    shares = {name: 100 * float(masks[name].mean()) for name in ("depression", "tethers")}
    said = ", ".join(f"{name} {share:.1f} %" for name, share in shares.items())
    typer.echo(f"{output}: {pixels} x {pixels} pixels, {said}")
