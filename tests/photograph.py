"""Synthetic photographs of tissues whose outline is known."""

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter
from skimage.draw import polygon2mask
from skimage.transform import downscale_local_mean

from raptor.measuring import Registration

FINE = 3  # points along the side of a pixel


@dataclass(frozen=True)
class Camera:
    """How a photograph is taken; lengths in pixels."""

    size: tuple[int, int] = (480, 640)
    scale: float = 9.0  # pixels per l0
    angle: float = 0.0  # degrees
    shift: tuple[float, float] = (0.0, 0.0)  # of the mould's origin from the middle: columns, rows
    mirrored: bool = False
    blur: float = 1.2
    noise: float = 0.03  # of the plate's brightness
    unevenness: float = 0.5  # of the light: half of the logarithm's range across the picture
    plate: float = 0.5
    floor: float = 0.7  # brightness over the plate's
    tissue: float = 1.3
    post: float = 0.5
    texture: float = 0.05

    @property
    def registration(self):
        turn = np.deg2rad(self.angle)
        flip = np.diag([1, 1 if self.mirrored else -1])
        rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        matrix = np.eye(3)
        matrix[:2, :2] = self.scale * rotation @ flip
        rows, columns = self.size
        matrix[:2, 2] = (columns - 1) / 2 + self.shift[0], (rows - 1) / 2 + self.shift[1]
        return Registration(matrix, "known", 0.0)


def photograph(mould, tissue, camera, seed=0):
    """An 8-bit photograph (row, column) of a tissue, a polygon in l0, in its mould."""
    rng = np.random.default_rng(seed)
    fine = camera.registration
    scene = np.full([FINE * side for side in camera.size], 1.0)
    cloth = gaussian_filter(rng.normal(size=camera.size), 3)
    cloth = np.kron(1 + camera.texture * cloth / cloth.std(), np.ones((FINE, FINE)))

    def paint(shape, value):
        for part in shapely.get_parts(shape):
            corners = FINE * fine.to_pixels(shapely.get_coordinates(part.exterior)) + (FINE - 1) / 2
            inside = polygon2mask(scene.shape, corners[:, ::-1])
            scene[inside] = (value * cloth)[inside] if np.ndim(value) or value == camera.tissue else value

    paint(mould.outline, camera.floor)
    paint(tissue.intersection(mould.outline), camera.tissue)
    for tether in mould.tethers:
        paint(tether.polygon, camera.post)
    seen = gaussian_filter(downscale_local_mean(scene, (FINE, FINE)), camera.blur)
    lit = camera.plate * seen * uneven_light(camera, rng)
    noisy = lit + camera.noise * camera.plate * rng.normal(size=lit.shape)
    return np.round(255 * np.clip(noisy, 0, 1)).astype(np.uint8)


def uneven_light(camera, rng):
    """A slope in a random direction, a lamp's bright patch and vignetting, (row, column)."""
    rows, columns = np.meshgrid(*(np.linspace(-1, 1, side) for side in camera.size), indexing="ij")
    direction = rng.uniform(0, 2 * np.pi)
    slope = np.cos(direction) * columns + np.sin(direction) * rows
    x, y = rng.uniform(-0.6, 0.6, 2)
    lamp = np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / 1.5)
    return np.exp(camera.unevenness * (0.7 * slope + 0.6 * lamp - 0.3 * (columns**2 + rows**2)))


def contracted(mould, waist, shrink, waves=0.0, seed=0):
    """A tissue drawn in to a waist in the middle, that wraps the tethers, with a wavy edge."""
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0, 2 * np.pi, 4)

    def pull(points):
        half_x, half_y = np.abs(mould.outline.bounds).reshape(2, 2).max(axis=0)
        u, v = points[:, 0] / half_x, points[:, 1] / half_y
        ripple = sum(
            np.cos(k * np.arctan2(v, u) + phase) for k, phase in zip((3, 5, 7, 9), phases, strict=True)
        )
        ripple = 1 + waves * ripple / 2
        return np.column_stack(
            [
                points[:, 0] * (1 - shrink - 0.5 * (waist - shrink) * (1 - v**2)) * ripple,
                points[:, 1] * (1 - shrink - (waist - shrink) * (1 - u**2)) * ripple,
            ]
        )

    return shapely.transform(shapely.segmentize(mould.outline, 0.3), pull).intersection(mould.depression)
