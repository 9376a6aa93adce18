"""Slow, clear twins of every kernel: loops over cells and bonds, one formula a line."""

import math
from collections import deque

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


def angle(a, b, centre):
    """By which the direction from a centre turns on the way from a to b, between -pi and pi."""
    turn = math.atan2(b[1] - centre[1], b[0] - centre[0]) - math.atan2(a[1] - centre[1], a[0] - centre[0])
    return (turn + math.pi) % (2 * math.pi) - math.pi


def smallest_loop_length(plane, centre):
    """Steps of the smallest closed path around a centre: breadth first over (site, angle turned so far)."""
    sites = [tuple(site) for site in plane.tolist()]
    occupied, best = set(sites), None
    for start in sites:
        seen, queue = {(start, 0)}, deque([(start, 0.0, 0)])
        while queue:
            (x, y), turned, steps = queue.popleft()
            if best is not None and steps >= best:
                break
            for other in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
                if other not in occupied:
                    continue
                now = turned + angle((x, y), other, centre)
                if other == start and round(abs(now) / (2 * math.pi)) == 1:
                    best = steps + 1
                # Ways to one site differ by whole turns.
                state = other, round((now - angle(start, other, centre)) / (2 * math.pi))
                if abs(state[1]) <= 1 and state not in seen:
                    seen.add(state)
                    queue.append((other, now, steps + 1))
    return best


def held(positions, sites, loops, centre):
    """Share of loops (numbers of sites, one a layer) whose angles still add up to one turn."""
    around = 0
    for loop in loops:
        total = sum(
            angle(positions[a], positions[b], centre) for a, b in zip(loop, [*loop[1:], loop[0]], strict=True)
        )
        around += abs(round(total / (2 * math.pi))) == 1
    return around / len(loops)


def contact(positions, polygon, reach, points=300):
    """Share of points along a polygon's rim that have a cell within reach."""
    near = 0
    for number in range(points):
        point = polygon.exterior.interpolate(number / points, normalized=True)
        near += min(math.dist((point.x, point.y), cell[:2]) for cell in positions) <= reach
    return near / points


def alignment(orientation, direction):
    """Along a direction in the plane against across it."""
    (ax, ay), along, across = direction, 0.0, 0.0
    for sx, sy, _ in orientation:
        along += (sx * ax + sy * ay) ** 2
        across += (-sx * ay + sy * ax) ** 2
    return (along - across) / (along + across)


def anisotropy(fields):
    """Difference over sum of the eigenvalues of the in-plane tensor, both summed over pixels."""
    split, total = 0.0, 0.0
    for row in range(fields.shape[1]):
        for column in range(fields.shape[2]):
            xx, yy, _, xy = fields[2:6, row, column]
            low, high = np.linalg.eigvalsh([[xx, xy], [xy, yy]])
            split, total = split + high - low, total + high + low
    return split / total
