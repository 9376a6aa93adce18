"""Physical constraints on predictions, by construction or by projection.

Density is non-negative, zero deeper than 5 sigma in a wall, and sums to the number of cells; the
orientation tensor (sums of s s^T over a pixel's cells) is positive semi-definite with the density as its
trace. Tension is zero where there is no tissue. The sign of (sxsz, sysz) is spontaneous, so averages are of
magnitudes.
"""

import math

import torch
from torch import Tensor, nn
from torch.nn.functional import conv2d, softplus

from raptor.dataset.scaling import Scaling
from raptor.frame import pixel_size
from raptor.raster import DEEP
from raptor.symmetry import FIELDS

SMALL = 1e-12
ROUNDING = 1e-5
TRACE = 0.01
"""Density, over its mean where it may be, below which there is no tissue that could carry tension."""

CELL_TENSION = 0.012
"""Mean bond tension of a cell at Delta 1, kappa0 l0; it grows as Delta^2 (exponent 1.98 over 576 runs)."""

XX, YY, ZZ, XY, XZ, YZ = (FIELDS.index(name) for name in ("sxsx", "sysy", "szsz", "sxsy", "sxsz", "sysz"))
ROWS = [[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]]


def reachable(depression: Tensor) -> Tensor:
    """Where density may be, (n, 1, y, x) of 0 and 1: within 5 sigma, and a pixel, of the depression.

    A pixel of a coarse image counts if any part of it does.
    """
    depression = (depression > 0).to(depression.dtype)
    size = pixel_size(depression.shape[-1])
    reach = DEEP + size
    radius = math.ceil(reach / size)
    steps = torch.arange(-radius, radius + 1, device=depression.device) * size
    disc = (steps[:, None] ** 2 + steps**2 <= reach**2).to(depression.dtype)
    return (conv2d(depression, disc[None, None], padding=radius) > 0.5).to(depression.dtype)


class PhysicalFields(nn.Module):
    """Turns eight free channels into scaled fields that obey the constraints.

    Density is softplus of the first channel, where it may be, scaled to the number of cells. The tensor is
    density L L^T / tr(L L^T) with L a lower triangle made of the last six channels. Tension is the second
    channel, in units of `CELL_TENSION` Delta^2 a cell, times density.
    """

    offset: Tensor
    scale: Tensor
    isotropic: Tensor

    def __init__(self, scaling: Scaling) -> None:
        super().__init__()
        self.register_buffer("offset", torch.tensor(scaling.offset)[:, None, None])
        self.register_buffer("scale", torch.tensor(scaling.scale)[:, None, None])
        self.register_buffer("isotropic", torch.tensor([1.0, 0.0, 1.0, 0.0, 0.0, 1.0])[:, None, None])

    def forward(self, free: Tensor, depression: Tensor, cells: Tensor, delta: Tensor) -> Tensor:
        """Scaled fields (n, 8, y, x); masks (n, 1, y, x) are from 0 to 1, numbers of cells and Delta (n,)."""
        there = reachable(depression)
        density = allowed_density(softplus(free[:, :1]), there, cells)
        a, b, c, d, e, f = torch.split(free[:, 2:] + self.isotropic, 1, dim=1)
        parts = [a * a, b * b + c * c, d * d + e * e + f * f, a * b, a * d, b * d + c * e]
        each = density / (parts[0] + parts[1] + parts[2] + SMALL)
        each_cell = CELL_TENSION * delta[:, None, None, None] ** 2 * free[:, 1:2]
        tension = each_cell * density * is_tissue(density, there, cells)
        fields = torch.cat([density, tension, *(each * part for part in parts)], dim=1)
        return (fields - self.offset) / self.scale


def project(fields: Tensor, there: Tensor, cells: Tensor) -> Tensor:
    """Fields (n, 8, y, x) in physical units projected onto the constraints, for networks that violate them.

    `there` is where density may be (`reachable`), (n or 1, 1, y, x); numbers of cells are (n or 1,). Negative
    density and density out of reach are set to zero and the rest is scaled to the cells; negative eigenvalues
    of the tensor are set to zero and its trace is scaled to the density.
    """
    density = allowed_density(fields[:, :1], there, cells)
    image, y, x = torch.nonzero(density[:, 0], as_tuple=True)  # the tensor is zero elsewhere
    found = fields[image, :, y, x]
    wanted = density[image, 0, y, x]
    tensor = found[:, ROWS]
    trace = tensor.diagonal(dim1=1, dim2=2).sum(1)
    # Eigenvalues dominate the cost, and few pixels need them.
    doubtful = ~_is_positive(found) | (trace <= SMALL)
    mended = _positive(tensor[doubtful], wanted[doubtful])
    tensor = tensor * (wanted / trace.clamp(min=SMALL))[:, None, None]
    tensor[doubtful] = mended
    tension = fields[:, 1:2] * is_tissue(density, there, cells)
    obeying = torch.cat([density, tension, torch.zeros_like(fields[:, 2:])], dim=1)
    for channel, (i, j) in {XX: (0, 0), YY: (1, 1), ZZ: (2, 2), XY: (0, 1), XZ: (0, 2), YZ: (1, 2)}.items():
        obeying[image, channel, y, x] = tensor[:, i, j]
    return obeying


def allowed_density(density: Tensor, there: Tensor, cells: Tensor) -> Tensor:
    """Density (n, 1, y, x) without what is negative or out of reach, scaled to the cells: as `project`."""
    kept = density.clamp(min=0.0) * there
    scaled: Tensor = kept * (cells[:, None, None, None] / (kept.sum((2, 3), keepdim=True) + SMALL))
    return scaled


def is_tissue(density: Tensor, there: Tensor, cells: Tensor) -> Tensor:
    """Where density (n, 1, y, x) is more than a trace, 1, else 0."""
    as_cast = cells[:, None, None, None] / there.sum((2, 3), keepdim=True).clamp(min=1.0)
    return (density > TRACE * as_cast).to(density.dtype)


def _is_positive(found: Tensor) -> Tensor:
    """Whether tensors, in fields (n, 8), are positive semi-definite, by their principal minors, (n,)."""
    xx, yy, zz, xy, xz, yz = (found[:, channel].double() for channel in (XX, YY, ZZ, XY, XZ, YZ))
    minors = (xx * yy - xy**2, xx * zz - xz**2, yy * zz - yz**2)
    determinant = xx * minors[2] - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    least = torch.stack([xx, yy, zz, *minors, determinant])
    return torch.amin(least, dim=0) >= 0


def _positive(tensor: Tensor, trace: Tensor) -> Tensor:
    """Tensors (n, 3, 3) without their negative eigenvalues, with a given trace (n,)."""
    size = tensor.abs().amax((1, 2), keepdim=True).clamp(min=SMALL)  # tiny tensors would not converge
    values, vectors = torch.linalg.eigh((tensor / size).double())
    values = values.clamp(min=0.0) + SMALL  # isotropic where nothing is known
    values = values * (trace / values.sum(1))[:, None]
    mended: Tensor = (vectors * values[:, None, :]) @ vectors.transpose(1, 2)
    return mended.to(tensor.dtype)


def with_sign(fields: Tensor) -> Tensor:
    """Means (n, 8, y, x) of predictions given signs: sxsz positive, sysz with the sign of sxsy.

    Both are shortened where the tensor would not stay positive semi-definite.
    """
    x, y = (fields[:, channel].clamp(min=0.0) for channel in (XZ, YZ))
    y = torch.where(fields[:, XY] < 0, -y, y)
    # v v^T <= szz A with A the tensor in the plane, or v^T adj(A) v <= szz det(A).
    a, b, c = fields[:, XX], fields[:, XY], fields[:, YY]
    # A tensor of few directions has almost no determinant, and rounding must not decide.
    room = fields[:, ZZ].clamp(min=0.0) * ((a * c - b * b).clamp(min=0.0) + ROUNDING * (a * c).abs())
    taken = c * x * x - 2 * b * x * y + a * y * y
    short = torch.where(taken > room, torch.sqrt(room / taken.clamp(min=SMALL)), 1.0)
    return torch.cat([fields[:, :XZ], (x * short)[:, None], (y * short)[:, None]], dim=1)
