"""One simulation, at the accuracy that a user asks for."""

import time
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from raptor.condor.accuracy import Accuracy, accuracy_named
from raptor.condor.anneal import anneal
from raptor.condor.contract import Contraction, contract, refine, steps_to
from raptor.condor.energy import cell_tension, inverted_fraction, objective
from raptor.condor.minimise import Minimum, minimise
from raptor.condor.network import build_network
from raptor.condor.system import System, build_system, cast_state
from raptor.condor.walls import NO_WALLS
from raptor.core.errors import RaptorError
from raptor.fields.directors import anisotropy, cell_alignment
from raptor.fields.labelled import MEASURES, TETHER_MEASURES, labelled
from raptor.fields.shape import shape_ratios
from raptor.fields.tethers import contact, held, posts_lost
from raptor.moulds.cast import CastMould
from raptor.moulds.geometry import Mould
from raptor.moulds.reading import as_mould
from raptor.parameters import LAYERS, CellParameters, NetworkModel, require_parameters
from raptor.raster import density_image, rasterise

if TYPE_CHECKING:
    import xarray as xr

PIXELS = 256
"""Along a side of the paper's image, which shape is measured in."""


@dataclass(frozen=True)
class Tissue:
    """A simulated tissue and how it was reached: what `simulate` returns.

    Parameters
    ----------
    mould : Mould
    parameters : CellParameters
    model : NetworkModel
    accuracy : str
    seed : int
        What was simulated.
    sites, positions : ndarray (cells, 3)
        Cast and final positions, l0.
    orientation : ndarray (cells, 3)
        Unit vectors; s and -s are the same cell.
    tension : ndarray (cells,)
        Mean over each cell's bonds, kappa0 l0.
    energy, wall_energy, contact_energy : float
        Of the bonds, of the walls, and of the contacts that keep bonds from reversing, kappa0 l0^2.
        Where the last is not zero, the state is a minimum with those contacts, not without.
    residual_gradient : float
        Largest component of the gradient, contacts included, by position or by orientation
        over Delta (at least 0.02), kappa0 l0.
    converged : bool
        Whether the gradient fell below the tolerance; never true for a bare anneal.
    inverted_fraction : float
        Share of bonds whose direction reversed.
    gradient_evaluations, sweeps : int
        Work done.
    wall_time : float
        Seconds.
    """

    mould: Mould
    parameters: CellParameters
    model: NetworkModel
    accuracy: str
    seed: int
    sites: NDArray[np.float64]
    positions: NDArray[np.float64]
    orientation: NDArray[np.float64]
    tension: NDArray[np.float64]
    energy: float
    wall_energy: float
    contact_energy: float
    residual_gradient: float
    converged: bool
    inverted_fraction: float
    gradient_evaluations: int
    sweeps: int
    wall_time: float

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.sites)

    @property
    def layers(self) -> int:
        """Cell layers between the mould's floor and the fill height."""
        return self.model.layers

    @cached_property
    def cast_mould(self) -> CastMould:
        """The mould as it was cast, and as an image of 256 pixels."""
        return CastMould(self.mould, self.layers, PIXELS)

    @property
    def area_ratio(self) -> float:
        """A/A0; NaN where the few cells of a mould are too sparse to be seen."""
        return float(self._ratios[0])

    @property
    def width_ratio(self) -> float:
        """w/w0 of the central section; NaN where it holds no tissue, as cast or as contracted."""
        return float(self._ratios[1])

    @cached_property
    def held(self) -> NDArray[np.float64]:
        """Share of layers in which the tissue still encircles each tether, (tethers,): see `tethers.held`."""
        return held(self.positions, self.cast_mould)

    @cached_property
    def contact(self) -> NDArray[np.float64]:
        """Share of each tether's rim with a cell within 1.5 l0, (tethers,)."""
        return contact(self.positions, self.cast_mould)

    @property
    def posts_lost(self) -> int:
        """Tethers held in fewer than half of the layers."""
        return posts_lost(self.held)

    @property
    def alignment(self) -> float:
        """1 where all cells lie along the mould's long side, -1 across it: see `directors.cell_alignment`."""
        return cell_alignment(self.orientation, self.cast_mould)

    @cached_property
    def anisotropy(self) -> float:
        """How far cells line up locally, whatever the direction, 0 to 1: see `directors.anisotropy`."""
        return anisotropy(self.rasterised())

    def fields(self, pixels: int = PIXELS) -> "xr.Dataset":
        """The eight fields (y, x) per pixel, named, with masks, parameters and the mould.

        See `raptor.fields.labelled` for what the Dataset holds.

        Parameters
        ----------
        pixels : int
            Along a side of the image of 62.5 l0.

        Raises
        ------
        RaptorError
            If the depression covers no pixel.
        """
        cast = self.cast_mould if pixels == PIXELS else CastMould(self.mould, self.layers, pixels)
        return labelled(
            self.rasterised(pixels),
            cast,
            self.parameters,
            {name: getattr(self, name) for name in MEASURES | TETHER_MEASURES},
            method="simulation",
            threshold=cast.threshold,
            accuracy=self.accuracy,
            seed=self.seed,
        )

    def to_dataset(self) -> "xr.Dataset":
        """The fields on the paper's raster: what is drawn of a tissue, and written to its file."""
        return self.fields()

    def rasterised(self, pixels: int = PIXELS) -> NDArray[np.float64]:
        """The eight fields as one array (8, y, x) in the order `symmetry.FIELDS`, per pixel."""
        return rasterise(self.positions, self.orientation, self.tension, pixels)

    @cached_property
    def _ratios(self) -> NDArray[np.float64]:
        return shape_ratios(density_image(self.positions, PIXELS), self.cast_mould)

    @property
    def numbers(self) -> dict[str, float | int | bool | str | list[float]]:
        """What was simulated and what came of it, by name."""
        return {
            "mould": self.mould.name, **asdict(self.parameters), "layers": self.layers,
            "accuracy": self.accuracy, "seed": self.seed, "cells": self.cells, "energy": self.energy,
            "converged": self.converged, "inverted_fraction": self.inverted_fraction,
            **{name: getattr(self, name) for name in MEASURES},
            **{name: getattr(self, name).tolist() for name in TETHER_MEASURES}, "wall_time": self.wall_time,
        }  # fmt: skip

    def __str__(self) -> str:
        state = "converged" if self.converged else "NOT converged"
        lost = f", {self.posts_lost} of {len(self.held)} tethers lost" if self.posts_lost else ""
        return (
            f"{self.cells} cells, energy {self.energy:.4g} kappa0 l0^2, {state}, inverted "
            f"{self.inverted_fraction:.1e}, A/A0 {self.area_ratio:.3f}, w/w0 {self.width_ratio:.3f}"
            f"{lost}, {self.wall_time:.1f} s"
        )


def simulate(
    mould: Mould | str | Path,
    cells: CellParameters,
    layers: int | NetworkModel = LAYERS,
    accuracy: str | Accuracy = "standard",
    seed: int = 0,
) -> Tissue:
    """Cast a mould, let it contract, and return the tissue.

    The result hangs on the arguments alone.

    Parameters
    ----------
    mould : Mould, str or Path
        A mould, or what `read_mould` reads: a name of the library, or a file.
    cells : CellParameters
        Delta and both spring constants, each in the range that the model allows.
    layers : int or NetworkModel
        Cell layers between the mould's floor and the fill height; or all the choices that the paper leaves
        open.
    accuracy : str or Accuracy
        "draft", "standard" or "reference", from the fastest to the most accurate; `ALLOWED` names the others.
    seed : int
        Of the first orientations and of every trial move, not negative.

    Raises
    ------
    RaptorError
        If the mould cannot be read or holds no cell, or another argument is none that is allowed.

    Examples
    --------
    >>> tissue = simulate("glial_1", CellParameters(0.5, 0.5, 0.3))
    """
    mould, cells = as_mould(mould), require_parameters(cells)
    model = layers if isinstance(layers, NetworkModel) else NetworkModel(layers)
    if seed < 0:
        raise RaptorError(f"seed is {seed}; give a whole number, 0 or more")
    known = accuracy_named(accuracy) if isinstance(accuracy, str) else accuracy
    return _contracted(mould, cells, model, known, seed)


def _contracted(
    mould: Mould, cells: CellParameters, model: NetworkModel, accuracy: Accuracy, seed: int
) -> Tissue:
    """The tissue of a cast mould, of arguments that are allowed."""
    started = time.perf_counter()
    rng = np.random.default_rng(seed)
    mixed = accuracy.precision == "mixed"
    system = build_system(mould, cells, model, "float32" if mixed else accuracy.precision)
    lattice = system.lattice
    minimum, sweeps = _solve(system, cells.delta, accuracy, rng)
    if mixed:
        system = replace(system, network=build_network(lattice))
        minimum = _in_double_precision(minimum, system, cells.delta, accuracy.contraction)
    state = minimum.state.astype(np.float64)
    touching = _contact_energy(minimum, system, cells.delta)
    if not mould.tethers:
        state = undrifted(state, lattice.sites, mould)
    return Tissue(
        mould=mould,
        parameters=cells,
        model=model,
        accuracy=accuracy.name,
        seed=seed,
        sites=lattice.sites,
        positions=state[: 3 * lattice.cells].reshape(3, -1).T.copy(),
        orientation=state[3 * lattice.cells :].reshape(3, -1).T.copy(),
        tension=cell_tension(state, lattice, cells.delta, model.tension),
        energy=minimum.energy,
        wall_energy=minimum.wall_energy - touching,
        contact_energy=touching,
        residual_gradient=minimum.residual_gradient,
        converged=minimum.converged and accuracy.minimised,
        inverted_fraction=inverted_fraction(state, lattice),
        gradient_evaluations=minimum.evaluations,
        sweeps=sweeps,
        wall_time=time.perf_counter() - started,
    )


def _in_double_precision(minimum: Minimum, system: System, delta: float, contraction: Contraction) -> Minimum:
    """A minimum found in single precision, minimised on in double, for the most part a few evaluations."""
    found = minimise(
        minimum.state.astype(np.float64),
        system.network,
        system.walls,
        delta,
        tolerance=contraction.tolerance,
        contact=minimum.contact,
        max_evaluations=contraction.max_evaluations,
    )
    both = found.converged and minimum.converged
    return found._replace(evaluations=minimum.evaluations + found.evaluations, converged=both)


def _contact_energy(minimum: Minimum, system: System, delta: float) -> float:
    """Energy of the contacts that a minimum was found with."""
    if minimum.contact == 0:
        return 0.0
    return objective(minimum.state, system.network, NO_WALLS, delta, minimum.contact)[1]


def undrifted(state: NDArray[np.float64], sites: NDArray[np.float64], mould: Mould) -> NDArray[np.float64]:
    """The state moved and turned in the plane as a whole, so that it lies as it was cast.

    Nothing holds a gel without tethers: moved or turned with its cells it has the same energy.
    Where walls are touched, before or after, it stays as it is.
    """
    blocks = state.reshape(6, -1).copy()
    cast, found = sites[:, :2] - sites[:, :2].mean(axis=0), blocks[:2].T - blocks[:2].mean(axis=1)
    cross = cast.T @ found
    angle = np.arctan2(cross[1, 0] - cross[0, 1], cross[0, 0] + cross[1, 1])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    blocks[:2] = turn @ found.T + sites[:, :2].mean(axis=0)[:, None]
    blocks[3:5] = turn @ blocks[3:5]
    planes = (state.reshape(6, -1)[:2], blocks[:2])
    free = all(mould.forbidden_depth(plane.T).max() < 0 for plane in planes)
    return blocks.ravel() if free else state


def _solve(system: System, delta: float, accuracy: Accuracy, rng: Generator) -> tuple[Minimum, int]:
    """Run an accuracy's solvers one after another; returns the minimum and the sweeps made."""
    state = cast_state(system.lattice.sites, rng).astype(system.network.stiffness.dtype)
    sweeps = accuracy.anneal_sweeps
    if sweeps:
        annealed = anneal(state, system.order, system.sublattices, system.walls, delta, rng, sweeps=sweeps)
        state = annealed.state
    minimum = contract(state, system, delta, accuracy.contraction, rng)
    minimum = refine(
        minimum,
        system,
        delta,
        accuracy.contraction,
        rng,
        hops=accuracy.hops,
        sweeps=accuracy.hop_sweeps,
    )
    sweeps += accuracy.hops * accuracy.hop_sweeps
    sweeps += len(steps_to(delta, accuracy.contraction.shortening)) * accuracy.contraction.sweeps
    return minimum, sweeps
