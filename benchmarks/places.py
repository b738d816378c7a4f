"""Captures of other kinds than the data has: a facade, a statue in a square, a plate on a table.

Each is rendered with daylight from parts such as the courtyard's, in 8 to 11 photographs of
800 x 600 as people take them. Units are meters; the plate's are 20 cm, so that its textures are as
fine as those of the others. World: x to the right, y away from the first photograph, z up.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float

from styletrf.geometry.camera_table import write_cameras
from styletrf.geometry.cameras import Camera
from styletrf.synthetic.courtyard import textures
from styletrf.synthetic.courtyard.lit_scene import lit_parts
from styletrf.synthetic.courtyard.mesh import Mesh, Vector, box, joined, lathe, panel, rod
from styletrf.synthetic.courtyard.paths import looking_at
from styletrf.synthetic.courtyard.render import developed, render_linear
from styletrf.synthetic.courtyard.scene import Part, flat
from styletrf.synthetic.courtyard.surround import surround_parts

WIDTH, HEIGHT = 800, 600
Points = Float[np.ndarray, "views 3"]


def facade(rng: np.random.Generator) -> tuple[list[Part], Points, Points]:
    """Returns the parts of a house seen from the street, with 11 centers and targets of views."""
    parts = [flat(panel((-16, 0, 0), (32, 0, 0), (0, -18, 0)),
                  textures.masonry((32, 18), textures.PAVING, rng))]  # fmt: skip
    for x, wide, high, color in ((-16, 8.9, 7.2, "#c98f6b"), (7.1, 8.9, 8.1, "#b7a58c")):
        side = panel((x, 0.3, high), (wide, 0, 0), (0, 0, -high))
        parts.append(flat(side, textures.plaster((wide, high), color, rng, worn=0.8)))
    front = panel((-7, 0, 9), (14, 0, 0), (0, 0, -9))
    parts.append(flat(front, textures.masonry((14, 9), textures.BRICK, rng)))
    for z in (3.1, 6.1, 8.9):
        parts += _block((-7.1, -0.25, z), (7.1, 0, z + 0.2), "#c9bb9f", rng)
    for column in range(5):
        for row in range(3):
            x, z = -6 + 2.6 * column, 1.0 + 3 * row
            if (column, row) != (2, 0):
                parts += _window(x, z, rng)
    door = panel((-0.75, -0.02, 2.5), (1.5, 0, 0), (0, 0, -2.5))
    parts.append(flat(door, textures.wood((1.5, 2.5), "#3f6b62", 0.16, rng)))
    bars = [rod((x, -0.8, 3.3), (x, -0.8, 4.2), 0.02) for x in np.linspace(-1.6, 1.6, 17)]
    parts.append(Part(joined(bars), textures.metal((1.0, 1.0), "#2c3330", rng)))
    centers = np.stack(
        [np.linspace(-5, 5, 11), rng.normal(-12.5, 0.5, 11), rng.normal(1.65, 0.05, 11)], axis=-1
    )
    targets = rng.normal([0, 0, 3.9], [0.6, 0, 0.3], (11, 3))
    return parts, centers, targets


def _window(x: float, z: float, rng: np.random.Generator) -> Iterator[Part]:
    glass = panel((x, -0.02, z + 1.5), (1.0, 0, 0), (0, 0, -1.5))
    yield flat(glass, textures.earthenware((1.0, 1.5), "#39464f", rng))
    yield from _block((x - 0.15, -0.2, z - 0.12), (x + 1.15, 0, z), "#c9bb9f", rng)
    for left in (x - 0.5, x + 1.0):
        shutter = box((left, -0.08, z), (left + 0.5, 0, z + 1.5))
        for side in shutter:
            yield flat(side, textures.wood((0.5, 1.5), "#7d4a38", 0.1, rng))


def statue(rng: np.random.Generator) -> tuple[list[Part], Points, Points]:
    """Returns the parts of a statue in a square, with 10 centers and targets around most of it."""
    ground = panel((-14, 14, 0), (28, 0, 0), (0, -28, 0))
    parts = [flat(ground, textures.masonry((28, 28), textures.PAVING, rng))]
    parts += surround_parts(int(rng.integers(1000)))
    parts += _block((-0.9, -0.9, 0), (0.9, 0.9, 0.3), "#a89a84", rng)
    parts += _block((-0.6, -0.6, 0.3), (0.6, 0.6, 1.5), "#c8bca4", rng)
    profile = np.array(
        [[0.0, 2.1], [0.12, 2.05], [0.15, 1.92], [0.09, 1.78], [0.28, 1.7], [0.34, 1.5],
         [0.24, 1.15], [0.3, 0.9], [0.4, 0.4], [0.46, 0.0]]
    )  # fmt: skip
    body = _folded(lathe((0, 0, 1.5), profile, 96, 5), rng)
    parts.append(Part(body, textures.earthenware((3.0, 2.5), "#b3a58c", rng)))
    angle = np.radians(np.linspace(-200, 20, 10)) + rng.normal(0, 0.05, 10)
    distance = rng.normal(4.6, 0.2, 10)
    heights = rng.normal(1.65, 0.05, 10)
    centers = np.stack([distance * np.cos(angle), distance * np.sin(angle), heights], axis=-1)
    return parts, centers, rng.normal([0, 0, 2.0], 0.08, (10, 3))


def _folded(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """Returns a body with folds along it, as cloth has them."""
    around = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0])
    waves = sum(
        rng.uniform(0.02, 0.06) * np.sin(n * around + rng.uniform(0, 6) + 2 * mesh.vertices[:, 2])
        for n in (2, 3, 5, 9, 14)
    )
    radius = np.linalg.norm(mesh.vertices[:, :2], axis=1, keepdims=True)
    moved = mesh.vertices + np.asarray(waves)[:, None] * radius / 0.4 * mesh.normals
    return Mesh(moved, mesh.normals, mesh.uv, mesh.triangles)


def plate(rng: np.random.Generator) -> tuple[list[Part], Points, Points]:
    """Returns the parts of a laid table in a room, with 9 centers and targets around a plate."""
    floor = panel((-9, 9, -3.7), (18, 0, 0), (0, -18, 0))
    parts = [flat(floor, textures.wood((18, 18), "#8a6a45", 0.8, rng))]
    for corner, along in (((-9, 9, 8), (18, 0, 0)), ((9, 9, 8), (0, -18, 0)),
                          ((9, -9, 8), (-18, 0, 0)), ((-9, -9, 8), (0, 18, 0))):  # fmt: skip
        wall = panel(corner, along, (0, 0, -11.7))
        parts.append(flat(wall, textures.plaster((18, 11.7), "#d9c39a", rng, worn=0.5)))
    for side in box((-3.7, -2.2, -0.2), (3.7, 2.2, 0)):
        parts.append(flat(side, textures.wood((7.4, 4.4), "#a67c4a", 0.5, rng)))
    dish = np.array([[0.0, 0.03], [0.42, 0.04], [0.5, 0.1], [0.68, 0.16], [0.69, 0.13], [0.45, 0]])
    parts.append(Part(lathe((0, 0, 0), dish, 64, 3), textures.glaze(rng), glossy=True))
    ball = np.array([[0.0, 0.34], [0.12, 0.33], [0.2, 0.2], [0.14, 0.05], [0.0, 0.0]])
    for x, y, color in ((-0.15, 0.1, "#a8433c"), (0.2, -0.05, "#88a83a"), (1.2, 0.6, "#c58a3e")):
        skin = textures.earthenware((1.2, 0.6), color, rng)
        parts.append(Part(lathe((x, y, 0.05), ball, 32, 4), skin))
    cup = np.array([[0.3, 0.5], [0.32, 0.5], [0.3, 0.25], [0.2, 0.0], [0.0, 0.0]])
    parts.append(Part(lathe((-1.4, 0.7, 0), cup, 40, 2), textures.glaze(rng)))
    cloth = panel((0.9, -0.2, 0.01), (0.9, 0, 0), (0, -1.2, 0))
    parts.append(flat(cloth, textures.masonry((0.9, 1.2), textures.RUBBLE, rng)))
    angle = np.radians(np.linspace(-230, 50, 9)) + rng.normal(0, 0.05, 9)
    distance, heights = rng.normal(3.0, 0.15, 9), rng.normal(2.2, 0.15, 9)
    centers = np.stack([distance * np.cos(angle), distance * np.sin(angle), heights], axis=-1)
    return parts, centers, rng.normal([0, 0, 0.1], 0.06, (9, 3))


def _block(low: Vector, high: Vector, color: str, rng: np.random.Generator) -> Iterator[Part]:
    for side in box(low, high):
        origin, right, _, down = side.vertices
        size = float(np.linalg.norm(right - origin)), float(np.linalg.norm(down - origin))
        yield flat(side, textures.earthenware(size, color, rng))


PLACES: dict[str, Callable[[np.random.Generator], tuple[list[Part], Points, Points]]] = {
    "facade": facade,
    "statue": statue,
    "plate": plate,
}


def write_place(name: str, folder: Path, seed: int = 0) -> None:
    """Writes the photographs of one of `PLACES`, and their cameras in `truth/cameras.parquet`."""
    rng = np.random.default_rng([seed, len(name)])
    parts, centers, targets = PLACES[name](rng)
    surfaces = lit_parts(parts)
    focal = 0.85 * WIDTH
    (folder / "images").mkdir(parents=True, exist_ok=True)
    cameras = []
    for index, pose in enumerate(looking_at(centers, targets, rng)):
        camera = Camera(
            f"{index:03d}.png", WIDTH, HEIGHT, focal, focal, WIDTH / 2, HEIGHT / 2, pose
        )
        light, _ = render_linear(surfaces, camera)
        picture = cv2.cvtColor(developed(light), cv2.COLOR_RGB2BGR)
        cv2.imwrite(str(folder / "images" / camera.name), picture)
        cameras.append(camera)
    (folder / "truth").mkdir(exist_ok=True)
    write_cameras(folder / "truth" / "cameras.parquet", cameras)
