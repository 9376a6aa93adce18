"""Many tissues at once: the same physics as one at a time. (On the processor; a GPU runs the same code.)"""

import numpy as np
import pytest
import shapely
import torch

from raptor.condor.contract import agitation_temperature
from raptor.condor.energy import cell_tension as tension_of_one
from raptor.condor.energy import inverted_fraction, unit_orientations
from raptor.condor.energy import objective as objective_of_one
from raptor.condor.gpu import agitate as agitation
from raptor.condor.gpu.agitate import agitate, uniform
from raptor.condor.gpu.contract import BatchSolver, Task
from raptor.condor.gpu.energy import cell_tension, objective, units
from raptor.condor.gpu.energy import inverted_fraction as inverted_in_batch
from raptor.condor.gpu.layout import BLOCK, ROW, build_batch, cast, join
from raptor.condor.gpu.raster import rasterise as rasterise_on
from raptor.condor.simulate import simulate
from raptor.condor.system import build_system, cast_state
from raptor.core.errors import RaptorError
from raptor.dataset import run as running
from raptor.dataset.check import check_shard
from raptor.dataset.shards import read_shard, write_shard
from raptor.fields.shape import shape_ratios
from raptor.moulds import Circle, Mould
from raptor.moulds.cast import CastMould
from raptor.parameters import CellParameters, NetworkModel
from raptor.raster import rasterise
from tests.small import CONFIG, design

pytestmark = pytest.mark.one_processor

SWEEPS = 100
CPU = torch.device("cpu")
MODEL = NetworkModel(2)
MOULDS = [
    Mould(shapely.box(-4.2, -2.3, 4.4, 2.1), (Circle(-2.5, 0.2, 0.7), Circle(2.5, 0.2, 0.7)), name="posts"),
    Mould(shapely.box(-3.2, -2.4, 3.4, 2.2), name="free"),
    Mould(shapely.Polygon([(-4, -1.5), (4, -3), (4, 3), (-4, 1.5)]), (Circle(2.5, 0.0, 0.9),), name="wedge"),
    Mould(shapely.box(-2.2, -2.3, 2.4, 2.1), name="block"),
]
CORNERS = [
    CellParameters(0.94, 0.1, 0.01),
    CellParameters(0.94, 0.7, 0.49),
    CellParameters(0.05, 0.1, 0.01),
    CellParameters(0.5, 0.5, 0.3),
]


def tasks(moulds, parameters, seeds=(0,), model=MODEL):
    return [Task(m, cast(m, model), p, seed) for m in moulds for p in parameters for seed in seeds]


def batch_of(chosen, model=MODEL):
    return build_batch([t.cast for t in chosen], [t.parameters for t in chosen], model, CPU)


def disturbed(batch, chosen, rng):
    """A disturbed state of a batch, and each tissue's own."""
    state = np.zeros((batch.blocks * BLOCK, 6), np.float32)
    state[:, :3] = batch.sites.movedim(1, 2).reshape(-1, 3)
    state[:, 3] = 1.0
    parts, first = [], 0
    for task in chosen:
        n = len(task.cast.sites)
        moved = task.cast.sites + rng.normal(0, 0.25, (n, 3))
        parts.append(np.concatenate([moved.T.ravel(), rng.normal(size=3 * n)]))
        state[first : first + n] = parts[-1].reshape(6, n).T
        first += task.cast.blocks * BLOCK
    blocks = np.ascontiguousarray(state.reshape(-1, BLOCK, 6).transpose(0, 2, 1))
    return torch.tensor(blocks), parts


def of_tissue(batch, values, number, cells):
    """A tissue's part of (blocks, ..., BLOCK), cells last."""
    part = values[batch.owner == number].movedim(0, -2)
    return part.reshape(*part.shape[:-2], -1)[..., :cells].numpy()


@pytest.mark.parametrize("shells", [(1, 2, 3), (1, 2, 4), (1, 3, 4)])
def test_energy_gradient_tension_and_folds_are_those_of_one_tissue(shells):
    model = NetworkModel(3, shells)
    chosen = tasks(MOULDS[:3], [CellParameters(0.6, 0.4, 0.2), CellParameters(0.9, 0.3, 0.0)], model=model)
    batch = batch_of(chosen, model)
    state, parts = disturbed(batch, chosen, np.random.default_rng(1))
    delta = torch.tensor([t.parameters.delta for t in chosen], dtype=torch.float64)
    contact = torch.full_like(delta, 50.0)
    found = objective(batch, state, delta, contact)
    inverted = inverted_in_batch(batch, state)
    for number, (task, part) in enumerate(zip(chosen, parts, strict=True)):
        system = build_system(task.mould, task.parameters, model)
        energy, wall_energy, gradient = objective_of_one(
            part, system.network, system.walls, task.parameters.delta, 50.0
        )
        assert float(found.energy[number]) == pytest.approx(energy, rel=1e-5)
        assert float(found.wall[number] + found.touching[number]) == pytest.approx(
            wall_energy, rel=1e-4, abs=1e-4
        )
        cells = system.lattice.cells
        ours = of_tissue(batch, found.gradient, number, cells).ravel()
        assert np.abs(ours - gradient).max() < 1e-4 * np.abs(gradient).max()
        assert float(inverted[number]) == pytest.approx(inverted_fraction(part, system.lattice))
        for kind in ("hooke", "literal"):
            wanted = tension_of_one(part, system.lattice, task.parameters.delta, kind)
            ours = of_tissue(batch, cell_tension(batch, state, delta, kind), number, cells)
            assert np.abs(ours - wanted).max() < 1e-5 * np.abs(wanted).max() + 1e-6


@pytest.mark.parametrize("shells", [(1, 2, 3), (1, 2, 4), (1, 3, 4)])
def test_bonds_have_two_ends_and_cells_of_a_colour_share_none(shells):
    batch = batch_of(tasks(MOULDS, CORNERS[:1], model=NetworkModel(5, shells)), NetworkModel(5, shells))
    colour, place = batch.colour, batch.places
    offsets = [tuple(o) for o in batch.directions.offsets]
    bonds = 0
    for row, offset in zip(batch.neighbours, offsets, strict=True):
        there = row >= 0
        block, lane = row[there] // ROW, row[there] % ROW
        back = batch.neighbours[offsets.index(tuple(-c for c in offset))][block, lane]
        assert (back == place[there]).all()
        assert (colour[block, lane] != colour[there]).all()
        bonds += int(there.sum())
    assert bonds == sum(
        2 * build_system(m, CORNERS[0], NetworkModel(5, shells)).lattice.bonds for m in MOULDS
    )


def test_tissues_taken_apart_and_joined_are_the_batch():
    chosen = tasks(MOULDS, CORNERS[:2])
    batch = batch_of(chosen)
    odd = torch.arange(batch.tissues) % 2 == 1
    back = join([batch.take(~odd), batch.take(odd)])
    state, _ = disturbed(batch, chosen, np.random.default_rng(2))
    delta = torch.linspace(0.1, 0.9, batch.tissues, dtype=torch.float64)
    none = torch.zeros_like(delta)
    whole = objective(batch, state, delta, none)
    there = torch.cat([state[batch.blocks_of(~odd)], state[batch.blocks_of(odd)]])
    parts = objective(back, there, torch.cat([delta[~odd], delta[odd]]), none)
    assert torch.equal(parts.energy, torch.cat([whole.energy[~odd], whole.energy[odd]]))
    assert torch.equal(parts.wall, torch.cat([whole.wall[~odd], whole.wall[odd]]))


def test_random_numbers_are_splitmix64():
    def slow(key, count):
        z = (key + count * 0x9E3779B97F4A7C15) % 2**64
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) % 2**64
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) % 2**64
        return ((z ^ (z >> 31)) >> 40) / 2**24

    keys = [0, 1, 2**63 + 11, 2**64 - 1]
    ours = uniform(torch.tensor(np.array(keys, np.uint64).astype(np.int64)), torch.tensor(5))
    assert ours.tolist() == [slow(key, 5) for key in keys]


def test_agitation_keeps_the_energy_that_metropolis_has_for_one_tissue(monkeypatch):
    """At a fixed temperature, after many sweeps: thermal means of the two implementations agree."""
    import raptor.condor.contract as contraction

    monkeypatch.setattr(contraction, "COOLING", 1.0)
    monkeypatch.setattr(agitation, "COOLING", 1.0)
    delta, parameters = 0.5, CORNERS[3]
    chosen = tasks(MOULDS[:1], [parameters], seeds=range(12))
    batch = batch_of(chosen)
    rng = np.random.default_rng(3)
    starts = [cast_state(t.cast.sites, np.random.default_rng(t.seed)) for t in chosen]
    state, _ = disturbed(batch, chosen, rng)
    for number, start in enumerate(starts):
        row = torch.tensor(start.reshape(6, -1), dtype=torch.float32)
        block = torch.zeros(6, chosen[0].cast.blocks * BLOCK)
        block[3], block[2] = 1.0, 0.7
        block[:, : row.shape[1]] = row
        state[batch.owner == number] = block.reshape(6, -1, BLOCK).movedim(1, 0)
    deltas = torch.full((batch.tissues,), delta, dtype=torch.float64)
    shaken = agitate(batch, state, deltas, SWEEPS, torch.arange(batch.tissues))
    ours = objective(batch, shaken, deltas, torch.zeros_like(deltas)).energy.numpy()
    system = build_system(chosen[0].mould, parameters, MODEL)
    theirs = []
    for start in starts:
        one = contraction.agitate(start, system, delta, SWEEPS, rng)
        theirs.append(objective_of_one(one, system.network, system.walls, delta)[0])
    temperature = agitation_temperature(delta)
    assert ours.mean() > 0.5 * temperature * system.lattice.cells  # hot: far from the minimum
    spread = np.hypot(np.std(ours), np.std(theirs)) / np.sqrt(len(starts))
    assert abs(ours.mean() - np.mean(theirs)) < 4 * spread
    assert torch.linalg.vector_norm(units(shaken)[0][:, 3:], dim=1).numpy() == pytest.approx(1, abs=1e-5)


@pytest.fixture(scope="module")
def contracted():
    """Each mould at two of the parameters, at most five at a time; and six seeds of each one by one."""
    both = zip(MOULDS, CORNERS, strict=True), zip(MOULDS, CORNERS[1:] + CORNERS[:1], strict=True)
    chosen = [task for pairs in both for mould, corner in pairs for task in tasks([mould], [corner])]
    together = dict(BatchSolver(chosen, MODEL, "standard", CPU, cells=10 * BLOCK).run())
    alone = {
        number: [simulate(t.mould, t.parameters, MODEL, "standard", seed) for seed in range(6)]
        for number, t in enumerate(chosen)
    }
    return chosen, together, alone


def test_tissues_of_a_batch_agree_within_the_spread_of_seeds(contracted):
    chosen, together, alone = contracted
    assert sorted(together) == list(range(8))
    energies, others, areas, spread_of_areas = [], [], [], []
    for number, task in enumerate(chosen):
        ours, theirs = together[number], alone[number]
        assert ours.converged
        assert ours.inverted_fraction == 0
        scale = task.parameters.delta**2 * ours.cells  # of energies of contraction; some gels come to rest
        mean = np.mean([s.energy for s in theirs])
        energies.append((ours.energy - mean) / scale)
        others += [(s.energy - mean) / scale for s in theirs]
        cast = CastMould(task.mould, MODEL.layers, 128)
        ratios = [
            shape_ratios(rasterise(s.positions, s.orientation, s.tension, 128)[0], cast)[0]
            for s in (ours, *theirs)
        ]
        areas.append(ratios[0] - np.mean(ratios[1:]))
        spread_of_areas.append(np.std(ratios[1:], ddof=1))
    spread = rms(others) * np.sqrt(6 / 5)
    assert rms(energies) < 2 * spread
    assert abs(np.mean(energies)) < 3 * spread * np.sqrt((1 + 1 / 6) / len(chosen))
    assert rms(areas) < 2.5 * rms(spread_of_areas)


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


def test_a_batch_states_what_the_kernel_finds_at_its_end(contracted):
    """Energy, gradient and tension of the final states, computed again in double precision."""
    chosen, together, _ = contracted
    for number, task in enumerate(chosen):
        tissue = together[number]
        system = build_system(task.mould, task.parameters, MODEL)
        state = np.concatenate([tissue.positions.T.ravel(), tissue.orientation.T.ravel()])
        energy = objective_of_one(
            unit_orientations(state), system.network, system.walls, task.parameters.delta
        )[0]
        assert tissue.energy == pytest.approx(energy, rel=1e-6)
        tension = tension_of_one(state, system.lattice, task.parameters.delta)
        assert np.abs(tissue.tension - tension).max() < 1e-6 * np.abs(tension).max()


def test_what_happens_to_a_tissue_does_not_hang_on_the_others():
    """On the processor, to the bit, whatever else is in the batch and in whatever order."""
    chosen = tasks(MOULDS[1:4], CORNERS[3:])
    few = dict(BatchSolver(chosen, MODEL, "standard", CPU, cells=BLOCK).run())
    many = dict(BatchSolver(chosen[::-1], MODEL, "standard", CPU, cells=99 * BLOCK).run())
    for number in range(3):
        one, other = few[number], many[2 - number]
        assert one.energy == other.energy
        assert np.array_equal(one.positions, other.positions)


def test_a_tissue_that_is_lost_takes_no_other_with_it():
    chosen = tasks(MOULDS[:3], CORNERS[3:])
    batch = batch_of(chosen)
    state, _ = disturbed(batch, chosen, np.random.default_rng(4))
    delta = torch.full((3,), 0.5, dtype=torch.float64)
    whole = objective(batch, state, delta, torch.zeros_like(delta))
    state[0, 0, 0] = torch.nan
    found = objective(batch, state, delta, torch.zeros_like(delta))
    assert found.energy[0].isnan()
    assert torch.equal(found.energy[1:], whole.energy[1:])
    assert found.gradient[batch.owner > 0].isfinite().all()


def test_accuracies_beyond_a_contraction_are_refused():
    with pytest.raises(RaptorError, match="contracted in batches at draft or standard"):
        BatchSolver(tasks(MOULDS[:1], CORNERS[:1]), MODEL, "reference", CPU)


def test_fields_are_those_of_the_kernel(contracted):
    _, together, _ = contracted
    tissue = together[3]
    cells = (tissue.positions, tissue.orientation, tissue.tension)
    for pixels in (64, 256):
        wanted = rasterise(*cells, pixels)
        assert np.abs(rasterise_on(*cells, pixels, CPU) - wanted).max() < 1e-5 * np.abs(wanted).max()


def test_a_shard_made_in_a_batch_holds_every_run_that_can_be_cast(monkeypatch, tmp_path):
    """As a GPU makes it, here on the processor; what fails there is tried again one by one."""
    runs, drawn = design().make()
    moulds = {mould.name: mould for mould in drawn}
    moulds[runs[2].mould] = Mould(shapely.box(0.1, 0.1, 0.4, 0.4), name="between sites")
    told = []
    model = CONFIG.network_model
    made = running._simulate_together(
        runs, moulds, model, "draft", "cpu", lambda run, outcome: told.append(run.simulation)
    )
    assert sorted(made) == sorted(told) == [0, 1, 3, 4, 5]
    monkeypatch.setattr(running, "_simulate_together", lambda *arguments: dict(made))
    simulations, failures = running.simulate_shard(runs, moulds, model, "draft", "cuda")
    assert sorted(simulations) == [0, 1, 3, 4, 5]
    assert "holds no cell" in failures[2]
    path = tmp_path / "00000-00005.nc"
    write_shard(path, runs, simulations, model, "draft", "c", failures, "cuda")
    assert list(check_shard(path)) == []  # energies and tensions computed again, to 1e-4
    assert read_shard(path).device == "cuda"
