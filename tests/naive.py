"""Slow, clear twins of every kernel: loops over cells and bonds, one formula a line."""

import math

import numpy as np


def bond(lattice, state, number, delta):
    """|l|, u and L' of one bond of a state (6 * cells,) with unit orientations."""
    blocks = state.reshape(6, -1)
    i, j = lattice.first[number], lattice.second[number]
    displacement = blocks[:3, j] - blocks[:3, i]
    length = np.linalg.norm(displacement)
    u = displacement / length
    si, sj = (blocks[3:, c] / np.linalg.norm(blocks[3:, c]) for c in (i, j))
    natural = lattice.rest_length[number] * (1 - delta / 2 * (2 - (u @ si) ** 2 - (u @ sj) ** 2))
    return length, u, natural


def bond_energy(lattice, state, delta):
    energy = 0.0
    for number in range(lattice.bonds):
        length, _, natural = bond(lattice, state, number, delta)
        energy += 0.5 * lattice.stiffness[number] * (length - natural) ** 2
    return energy


def contact_energy(lattice, state, stiffness, part):
    energy = 0.0
    positions = state.reshape(6, -1)[:3]
    for i, j, rest in zip(lattice.first, lattice.second, lattice.rest_length, strict=True):
        cast = (lattice.sites[j] - lattice.sites[i]) / rest
        ahead = (positions[:, j] - positions[:, i]) @ cast
        energy += 0.5 * stiffness * max(0.0, part * rest - ahead) ** 2
    return energy


def cell_tension(lattice, state, delta, kind):
    tensions = [[] for _ in range(lattice.cells)]
    for number in range(lattice.bonds):
        length, _, natural = bond(lattice, state, number, delta)
        value = lattice.stiffness[number] * (length - natural if kind == "hooke" else natural)
        tensions[lattice.first[number]].append(value)
        tensions[lattice.second[number]].append(value)
    return np.array([np.mean(values) if values else 0.0 for values in tensions])


def wall_energy(mould, height, state, stiffness):
    """Wall energy from exact distances, without a table."""
    x, y, z = state.reshape(6, -1)[:3]
    depth = np.maximum(0, mould.forbidden_depth(np.column_stack([x, y])))
    below = np.maximum(0, -z) + np.maximum(0, z - height)
    return 0.5 * stiffness * float((depth**2 + below**2).sum())


def rasterise(positions, orientation, tension, pixels, sigma, image_size):
    size = image_size / pixels
    image = np.zeros((8, pixels, pixels))
    for (x, y), (sx, sy, sz), t in zip(positions[:, :2], orientation, tension, strict=True):
        values = (1.0, t, sx * sx, sy * sy, sz * sz, sx * sy, sx * sz, sy * sz)
        for row in range(pixels):
            for column in range(pixels):
                weight = 1.0
                for centre, number in ((x, column), (y, row)):
                    low = -image_size / 2 + number * size
                    ends = ((edge - centre) / (sigma * math.sqrt(2)) for edge in (low + size, low))
                    above, below = (math.erf(end) for end in ends)
                    weight *= 0.5 * (above - below)
                image[:, row, column] += np.multiply(values, weight)
    return image


def bonds(sites, shells):
    """Pairs of sites at the distance of each shell, found by trying all pairs."""
    found = set()
    for i in range(len(sites)):
        for j in range(i + 1, len(sites)):
            distance = np.linalg.norm(sites[j] - sites[i])
            for shell, wanted in shells.items():
                if abs(distance - wanted) < 1e-6:
                    found.add((i, j, shell))
    return found


def lbfgs_direction(pairs, gradient):
    """Nocedal and Wright, algorithm 7.4, for pairs (s, y), the newest last."""
    q, alphas = gradient.copy(), []
    for s, y in reversed(pairs):
        alphas.append(s @ q / (s @ y))
        q -= alphas[-1] * y
    if pairs:
        s, y = pairs[-1]
        q *= (s @ y) / (y @ y)
    for (s, y), alpha in zip(pairs, reversed(alphas), strict=True):
        q += (alpha - y @ q / (s @ y)) * s
    return -q
