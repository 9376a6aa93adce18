"""Synthetic photographs of tissues whose outline is known.

`python -m tests.photograph FOLDER` writes the set, and prints what is measured in it beside the truth.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import shapely
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from scipy.ndimage import distance_transform_edt, gaussian_filter
from skimage import io

from raptor.core.errors import RaptorError
from raptor.fields.shape import outline_ratios
from raptor.imaging import Registration, as_picture, measure, register
from raptor.moulds import read_mould


@dataclass(frozen=True)
class Camera:
    """How a photograph is taken; lengths in pixels."""

    size: tuple[int, int] = (600, 800)
    scale: float = 11.0  # pixels per l0
    angle: float = 0.0  # degrees
    shift: tuple[float, float] = (0.0, 0.0)  # of the mould's origin from the middle: columns, rows
    mirrored: bool = False
    blur: float = 1.2
    noise: float = 0.03  # of the plate's brightness
    unevenness: float = 0.5  # of the light: half of the logarithm's range across the picture
    plate: float = 0.35
    floor: float = 0.7  # brightness over the plate's
    tissue: float = 1.3
    post: float = 0.5
    texture: float = 0.05
    wall: float = 0.0  # width of a dark band around the rim, l0
    shadow: float = 0.0  # how much of the light a post's shadow takes; it lies 1.5 l0 to one side
    meniscus: float = 0.0  # brightness that the medium's curved edge adds, falling over 1 l0 from the rim
    glare: float = 0.0  # brightness of a lamp's reflection 4 l0 wide, over the plate's
    tint: float = 0.0  # how much of the light a coloured medium takes from the whole depression

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


def coverage(shape, camera):
    """Share of each pixel (row, column) that lies in a shape, l0."""
    rows, columns = camera.size
    figure = Figure(figsize=(columns / 100, rows / 100), dpi=100, facecolor="black")
    parts = shapely.get_parts(shape)
    rings = [(part.exterior, "white") for part in parts]
    rings += [(hole, "black") for part in parts for hole in part.interiors]
    for ring, colour in rings:
        column, row = camera.registration.to_pixels(shapely.get_coordinates(ring)).T
        corners = np.column_stack([column + 0.5, rows - row - 0.5])  # a pixel's corner, from below
        figure.add_artist(Polygon(corners, facecolor=colour, edgecolor="none", transform=None, snap=False))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., 0] / 255


def photograph(mould, tissue, camera, seed=0):
    """An 8-bit photograph (row, column) of a tissue, a polygon in l0, in its mould."""
    rng = np.random.default_rng(seed)
    cloth = gaussian_filter(rng.normal(size=camera.size), 3)
    cloth = camera.tissue * (1 + camera.texture * cloth / cloth.std())
    scene = np.ones(camera.size)
    if camera.wall > 0:
        scene += coverage(mould.outline.buffer(camera.wall, join_style="mitre"), camera) * (0.4 - scene)
    layers = [(mould.outline, camera.floor), (tissue.intersection(mould.outline), cloth)]
    for shape, brightness in [*layers, *((tether.polygon, camera.post) for tether in mould.tethers)]:
        scene += coverage(shape, camera) * (brightness - scene)
    scene = real(scene, mould, camera)
    lit = camera.plate * gaussian_filter(scene, camera.blur) * uneven_light(camera, rng)
    noisy = lit + camera.noise * camera.plate * rng.normal(size=lit.shape)
    return np.round(255 * np.clip(noisy, 0, 1)).astype(np.uint8)


def real(scene, mould, camera):
    """The scene with what photographs of dishes show: shadows of posts, meniscus, glare, coloured medium."""
    if not any((camera.shadow, camera.meniscus, camera.glare, camera.tint)):
        return scene
    posts = shapely.union_all([tether.polygon for tether in mould.tethers])
    cast = shapely.affinity.translate(posts, 1.5, -0.7).difference(posts).intersection(mould.outline)
    inside = coverage(mould.outline, camera)
    scene = scene * (1 - camera.shadow * gaussian_filter(coverage(cast, camera), 0.2 * camera.scale))
    from_rim = distance_transform_edt(inside > 0.5) / camera.scale
    scene = scene + camera.meniscus * inside * np.exp(-from_rim)
    scene = scene * (1 - camera.tint * inside)
    spot = coverage(shapely.Point(3, 2).buffer(2), camera)
    return scene + camera.glare * gaussian_filter(spot, 0.5 * camera.scale)


def uneven_light(camera, rng):
    """A slope in a random direction, a lamp's bright patch and vignetting, (row, column)."""
    rows, columns = np.meshgrid(*(np.linspace(-1, 1, side) for side in camera.size), indexing="ij")
    direction = rng.uniform(0, 2 * np.pi)
    slope = np.cos(direction) * columns + np.sin(direction) * rows
    x, y = rng.uniform(-0.6, 0.6, 2)
    lamp = np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / 1.5)
    return np.exp(camera.unevenness * (0.7 * slope + 0.6 * lamp - 0.3 * (columns**2 + rows**2)))


def contracted(mould, waist, shrink, waves=0.0, seed=0):
    """A tissue drawn in to a waist in the middle, that wraps the tethers, with a wavy edge.

    Without threads of less than 0.6 l0, which no tissue has and no photograph shows.
    """
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

    outline = shapely.transform(shapely.segmentize(mould.outline, 0.3), pull)
    return outline.intersection(mould.depression).buffer(-0.3).buffer(0.3)


@dataclass(frozen=True)
class Case:
    """A tissue in a standard mould, and how it is photographed."""

    mould: str
    waist: float
    shrink: float
    camera: Camera
    waves: float = 0.02

    def made(self):
        """The mould, the tissue and its photograph."""
        seed = CASES.index(self)
        mould = read_mould(self.mould)
        tissue = contracted(mould, self.waist, self.shrink, self.waves, seed)
        return mould, tissue, photograph(mould, tissue, self.camera, seed)


DARK_FLOOR = {"floor": 0.7, "tissue": 1.3, "post": 0.5}
BRIGHT_FLOOR = {"floor": 1.5, "tissue": 0.8, "post": 0.4}
BLACK = {"floor": 0.6, "tissue": 0.3, "post": 1.2}
WHITE = {"floor": 1.3, "tissue": 1.8, "post": 0.6}
PALE = {"floor": 0.75, "tissue": 1.05, "post": 0.4}
SQUARE = (700, 700)
CASES = (
    Case("four_post_rectangle", 0.35, 0.08, Camera(angle=17, unevenness=0.8, **DARK_FLOOR)),
    Case("four_post_rectangle", 0.50, 0.05, Camera(SQUARE, 10, 48, (6, -9), noise=0.05, **BRIGHT_FLOOR)),
    Case("reference_rectangle", 0.20, 0.04, Camera(angle=-8, shift=(12, 20), **BLACK)),
    Case("small_rectangle", 0.30, 0.06, Camera(SQUARE, 20, 133, noise=0.05, **WHITE)),
    Case("free_square", 0.25, 0.25, Camera(SQUARE, 14, 31, blur=2.0, **DARK_FLOOR)),
    Case("free_square", 0.40, 0.40, Camera(SQUARE, 14, -70, unevenness=0.8, **PALE)),
    Case("i_shape", 0.35, 0.05, Camera(angle=172, **WHITE)),
    Case("glial_1", 0.20, 0.03, Camera(angle=5, unevenness=0.8, noise=0.05, **DARK_FLOOR)),
    Case("glial_2", 0.25, 0.06, Camera(SQUARE, 10, 100, mirrored=True, **DARK_FLOOR)),
    Case("glial_3", 0.25, 0.10, Camera(angle=-12, blur=2.0, **BRIGHT_FLOOR)),
    Case("fibroblast", 0.55, 0.07, Camera(SQUARE, 9.5, 61, unevenness=0.7, **BLACK)),
    Case("corneal", 0.60, 0.08, Camera(angle=3, noise=0.05, **DARK_FLOOR)),
    Case("tenocyte", 0.45, 0.10, Camera(SQUARE, 10, -45, **BRIGHT_FLOOR)),
    Case("myoblast", 0.40, 0.07, Camera(angle=-160, unevenness=0.8, **PALE)),
    Case("myoblast", 0.15, 0.06, Camera(SQUARE, 11, 40, (-5, 8), True, noise=0.04, **BLACK)),
)


KINDS = {
    "shadow of the posts, 30 % darker": {"shadow": 0.3},
    "shadow of the posts, 60 % darker": {"shadow": 0.6},
    "meniscus, 20 % of the plate's brightness at the rim": {"meniscus": 0.2},
    "meniscus, 50 %": {"meniscus": 0.5},
    "glare, half the plate's brightness": {"glare": 0.5},
    "glare, twice the plate's brightness, over-exposed": {"glare": 2.0},
    "medium that takes 20 % of the light": {"tint": 0.2},
    "medium that takes 40 %": {"tint": 0.4},
}
"""What real photographs show, by name, as settings of the camera."""


def by_kind(case, number=0):
    """Errors of A/A0 and w/w0 of a case with each of `KINDS`; the refusal's sentence where it is refused."""
    mould, tissue, _ = case.made()
    area, width = outline_ratios(tissue, mould)
    for name, settings in KINDS.items():
        picture = as_picture(photograph(mould, tissue, replace(case.camera, **settings), number), case.mould)
        try:
            found = measure(picture, mould, register(picture, mould, mirrored=case.camera.mirrored))
        except RaptorError as error:
            yield name, str(error)
        else:
            yield name, (found.area_ratio - area, found.width_ratio - width)


def main(folder):
    """Write the set; print truth and error of A/A0 and w/w0."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, case in enumerate(CASES, start=1):
        mould, tissue, pixels = case.made()
        io.imsave(folder / f"{number:02d}_{case.mould}.png", pixels, check_contrast=False)
        picture = as_picture(pixels, case.mould)
        found = measure(picture, mould, register(picture, mould, mirrored=case.camera.mirrored))
        area, width = outline_ratios(tissue, mould)
        sys.stdout.write(
            f"| {number} {case.mould} | {case.camera.angle} | {area:.3f} | {width:.3f} "
            f"| {found.area_ratio - area:+.4f} | {found.width_ratio - width:+.4f} "
            f"| {found.registration.residual:.3f} | {found.contrast:.1f} |\n"
        )
    for case in CASES[:3]:
        for name, errors in by_kind(case):
            said = errors if isinstance(errors, str) else "{:+.4f} | {:+.4f}".format(*errors)
            sys.stdout.write(f"| {case.mould} | {name} | {said} |\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
