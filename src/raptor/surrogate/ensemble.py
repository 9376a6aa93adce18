"""What an ensemble of networks predicts of one tissue: a mean, and realisations that scatter about it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from raptor.fields.directors import alignment, anisotropy
from raptor.fields.resample import deconvolve
from raptor.fields.shape import shape_ratios
from raptor.fields.tethers import seen_held
from raptor.moulds.cast import CastMould, once_per_cast
from raptor.surrogate.constraints import allowed_density, project, reachable

DETAIL = 128
"""Pixels along a side at which local alignment is measured: block averages twice as wide mix directions."""


@dataclass(frozen=True)
class Realisations:
    """A mean and its realisations: samples, or, of networks that give one mean, each network's.

    Parameters
    ----------
    cast : CastMould
    densities : ndarray (1 + n, y', x')
        The mean's, then those of the realisations, on the networks' raster.
    directions : ndarray (1 + n, 2)
        Alignment and anisotropy, likewise.
    sampled : bool
        Whether each realisation is a possible tissue. Measures are then means over these; of blurred means
        they would be biased.
    """

    cast: CastMould
    densities: NDArray[np.float32]
    directions: NDArray[np.float64]
    sampled: bool

    @classmethod
    def of(cls, cast: CastMould, fields: NDArray[np.float32], *, sampled: bool) -> "Realisations":
        """Those of fields (1 + n, 8, y', x'), the mean first."""
        coarse = fields.shape[-1]
        # By torch: numpy's own threads would get in the way of those that predict.
        fine = deconvolve(torch.from_numpy(fields), max(coarse, min(DETAIL, cast.pixels))).numpy()
        directions = [alignment(each, cast) for each in fields], [anisotropy(each) for each in fine]
        return cls(cast, fields[:, 0], np.array(directions).T, sampled)

    def of_mean(self, threshold: float) -> NDArray[np.float64]:
        """The mean's `bands.MEASURED` (4,); `threshold` is the density above which there is tissue."""
        return np.array([*shape_ratios(self.mean_density, self.cast, threshold), *self.directions[0]])

    def measure(
        self, threshold: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Estimates of `bands.MEASURED` (4,), their deviations (4,) and chances of tethers (tethers,).

        The chance that tissue encloses a tether is the share of realisations in which it does; NaN if the
        tissue as cast does not enclose it: see `tethers.seen_held`.
        """
        densities = full_density(self.densities[1:], self.cast)
        ratios = [shape_ratios(density, self.cast, threshold) for density in densities]
        each = np.column_stack([ratios, self.directions[1:]])
        estimates = _mean(each) if self.sampled else self.of_mean(threshold)
        held = np.mean([seen_held(density, self.cast, threshold) for density in densities], axis=0)
        return estimates, deviation(each), held

    @cached_property
    def mean_density(self) -> NDArray[np.float32]:
        """The mean's density (y, x) at full resolution."""
        (density,) = full_density(self.densities[:1], self.cast)
        return np.asarray(density)


@dataclass(frozen=True)
class Ensemble:
    """Predictions of the networks of an ensemble for one tissue, in physical units.

    Parameters
    ----------
    mean : ndarray (8, y, x)
        Over networks and images of D4, projected onto the physical constraints.
    deviation : ndarray (8, y, x)
        Standard deviation over networks and images, sxsz and sysz by magnitude.
    answers : ndarray (n, 8, y', x')
        Of each network for each image of D4, moved back, on the networks' raster; samples if they sample.
    realisations : Realisations
    """

    mean: NDArray[np.float32]
    deviation: NDArray[np.float32]
    answers: NDArray[np.float32]
    realisations: Realisations


def full_density(coarse: NDArray[np.float32], cast: CastMould) -> NDArray[np.float32]:
    """Densities (n, y, x) at a mould's resolution from block averages, as the physics allows."""
    fine = deconvolve(torch.from_numpy(coarse), cast.pixels)[:, None]
    return np.asarray(allowed_density(fine, *limits(cast))[:, 0].numpy())


def full_fields(coarse: NDArray[np.float32], cast: CastMould) -> NDArray[np.float32]:
    """Fields (n, 8, y, x) at a mould's resolution from block averages, as the physics allows."""
    return np.asarray(project(deconvolve(torch.from_numpy(coarse), cast.pixels), *limits(cast)).numpy())


@once_per_cast
def limits(cast: CastMould) -> tuple[Tensor, Tensor]:
    """Where a mould's density may be (1, 1, y, x), and its number of cells (1,): for `project`."""
    depression = torch.from_numpy(cast.depression.astype(np.float32))[None, None]
    return reachable(depression), torch.tensor([float(cast.n_cells)])


def _mean(each: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means (k,) of (n, k) without NaN; NaN of those that are all NaN."""
    known = np.isfinite(each)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(known, each, 0.0).sum(axis=0) / known.sum(axis=0))


def deviation(each: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviations (k,) over realisations (n, k); 0 of a single one."""
    if len(each) < 2:
        return np.zeros(each.shape[1])
    return np.asarray(np.nan_to_num(each.std(axis=0, ddof=1)))
