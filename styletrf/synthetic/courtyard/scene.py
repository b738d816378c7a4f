"""The courtyard: walls, paving, a door and a window, railings, a plant, ivy, a vase on a pedestal.

World: meters, x to the right, y into the scene, z up; the paving is z = 0, the pedestal stands at
the origin, the walls are at x = -3.5 and 3.5, y = -5.2 and 3.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from styletrf.synthetic.courtyard import textures
from styletrf.synthetic.courtyard.mesh import (
    Mesh,
    Vector,
    box,
    joined,
    lathe,
    leaf,
    panel,
    rod,
    tube,
    unit,
)

LEFT, RIGHT, FRONT, BACK = -3.5, 3.5, -5.2, 3.0
_IRON = "#2c3330"


@dataclass(frozen=True, slots=True)
class Part:
    """A mesh and its albedo.

    `panel_size` is the extent (meters) of a flat parallelogram, whose light is kept in its texture;
    a part without it is lit at its vertices. Light passes through a `translucent` part.
    """

    mesh: Mesh
    texture: textures.Texture
    panel_size: tuple[float, float] | None = None
    translucent: bool = False
    glossy: bool = False


def courtyard_parts(seed: int, *, glossy: bool) -> list[Part]:
    """Returns everything in the courtyard; without `glossy` the vase is left out."""
    rng = np.random.default_rng([seed, 2022])
    makers = [_ground_and_walls, _openings, _bench, _railings, _pedestal, _potted_plant, _ivy]
    parts = [part for maker in makers for part in maker(rng.spawn(1)[0])]
    return [*parts, _vase(rng)] if glossy else parts


def flat(mesh: Mesh, texture: textures.Texture) -> Part:
    """Returns a panel, whose light is kept in its texture."""
    return Part(mesh, texture, panel_size=_extent(mesh))


def _extent(mesh: Mesh) -> tuple[float, float]:
    """Returns the sides of a panel in meters."""
    origin, right, _, down = mesh.vertices
    return float(np.linalg.norm(right - origin)), float(np.linalg.norm(down - origin))


def _ground_and_walls(rng: np.random.Generator) -> Iterator[Part]:
    wide, deep = RIGHT - LEFT, BACK - FRONT
    floor = panel((LEFT, BACK, 0), (wide, 0, 0), (0, -deep, 0))
    yield flat(floor, textures.masonry((wide, deep), textures.PAVING, rng))
    back = panel((LEFT, BACK, 3.1), (wide, 0, 0), (0, 0, -3.1))
    yield flat(back, textures.plaster((wide, 3.1), "#d8b98a", rng, worn=0.55))
    left = panel((LEFT, FRONT, 2.5), (0, deep, 0), (0, 0, -2.5))
    yield flat(left, textures.plaster((deep, 2.5), "#c99a7a", rng, worn=0.9))
    right = panel((RIGHT, BACK, 2.5), (0, -deep, 0), (0, 0, -2.5))
    yield flat(right, textures.masonry((deep, 2.5), textures.RUBBLE, rng))
    front = panel((RIGHT, FRONT, 2.2), (-wide, 0, 0), (0, 0, -2.2))
    yield flat(front, textures.masonry((wide, 2.2), textures.BRICK, rng))
    for low, high in (
        ((LEFT - 0.3, FRONT, 2.5), (LEFT + 0.07, BACK, 2.6)),
        ((RIGHT - 0.07, FRONT, 2.5), (RIGHT + 0.3, BACK, 2.6)),
        ((LEFT - 0.3, BACK - 0.08, 3.1), (RIGHT + 0.3, BACK + 0.3, 3.2)),
    ):
        yield from _block(low, high, "#b3a58c", rng)
    yield from _roof_tiles(rng)


def _block(low: Vector, high: Vector, color: str, rng: np.random.Generator) -> Iterator[Part]:
    for side in box(low, high):
        yield flat(side, textures.earthenware(_extent(side), color, rng))


def _roof_tiles(rng: np.random.Generator) -> Iterator[Part]:
    colors = [textures.earthenware((0.6, 0.6), c, rng) for c in ("#b5603c", "#9c4c30", "#c67a50")]
    rows: list[list[Mesh]] = [[], [], []]
    for x in np.arange(LEFT - 0.2, RIGHT + 0.3, 0.19):
        lift = 3.27 + 0.012 * rng.standard_normal()
        tile = rod((x, BACK - 0.14, lift - 0.04), (x, BACK + 0.3, lift + 0.12), 0.085, 2, 9)
        end = lathe((0, 0, 0), np.array([[0.0, 0.0], [0.085, -1e-3]]), 9)
        turned = end.vertices[:, [0, 2, 1]] + [x, BACK - 0.14, lift - 0.04]
        cap = Mesh(turned, np.tile([0.0, -1.0, 0.0], (len(turned), 1)), end.uv, end.triangles)
        rows[int(rng.integers(3))] += [tile, cap]
    for row, texture in zip(rows, colors, strict=True):
        yield Part(joined(row), texture)


def _openings(rng: np.random.Generator) -> Iterator[Part]:
    y = BACK - 0.03
    yield flat(
        panel((0.75, y, 2.15), (1.1, 0, 0), (0, 0, -2.15)),
        textures.wood((1.1, 2.15), "#3f6b62", 0.16, rng),
    )
    for low, high in (
        ((0.58, BACK - 0.12, 0), (0.75, BACK, 2.3)),
        ((1.85, BACK - 0.12, 0), (2.02, BACK, 2.3)),
        ((0.5, BACK - 0.15, 2.15), (2.1, BACK, 2.37)),
        ((-2.35, BACK - 0.16, 0.98), (-0.75, BACK, 1.1)),
    ):
        yield from _block(low, high, "#c9bb9f", rng)
    glass = panel((-1.95, y, 2.2), (0.8, 0, 0), (0, 0, -1.1))
    yield flat(glass, textures.earthenware((0.8, 1.1), "#39464f", rng))
    for x in (-2.37, -1.13):
        shutter = box((x, BACK - 0.08, 1.1), (x + 0.4, BACK, 2.22))
        for side in shutter:
            yield flat(side, textures.wood(_extent(side), "#7d4a38", 0.1, rng))
    bars = [rod((x, BACK - 0.07, 1.1), (x, BACK - 0.07, 2.2), 0.012) for x in (-1.75, -1.55, -1.35)]
    bars += [rod((-1.97, BACK - 0.07, z), (-1.13, BACK - 0.07, z), 0.012) for z in (1.4, 1.7, 2.0)]
    yield Part(joined(bars), textures.metal((0.5, 0.5), _IRON, rng))


def _bench(rng: np.random.Generator) -> Iterator[Part]:
    x = LEFT + 0.35
    planks = [((x + dx, 0.2, 0.42), (x + dx + 0.13, 1.9, 0.46)) for dx in (0.0, 0.16, 0.32)]
    legs = [((x + 0.02, y, 0), (x + 0.43, y + 0.1, 0.42)) for y in (0.35, 1.65)]
    backs = [((x - 0.06, 0.2, z), (x - 0.02, 1.9, z + 0.13)) for z in (0.6, 0.8)]
    for low, high in planks + legs + backs:
        for side in box(low, high):
            yield flat(side, textures.wood(_extent(side), "#8a6a45", 0.2, rng))
    crate = box((2.35, 1.3, 0), (2.95, 1.85, 0.5))
    for side in crate:
        yield flat(side, textures.wood(_extent(side), "#a67c4a", 0.12, rng))


def _railings(rng: np.random.Generator) -> Iterator[Part]:
    y, bars = -2.2, []
    for x0, x1 in ((LEFT, -0.95), (1.05, RIGHT)):
        for z in (0.1, 0.66, 0.82):
            bars.append(rod((x0, y, z), (x1, y, z), 0.014, 24))
        for x in np.linspace(x0, x1, round((x1 - x0) / 0.17) + 1)[1:-1]:
            bars.append(rod((x, y, 0), (x, y, 0.82), 0.009, 8))
            bars.append(_ring((x + 0.085, y, 0.74), 0.062))
    ends = [(-0.95, y, 0.0), (1.05, y, 0.0)]
    post = np.array([[0.0, 1.08], [0.05, 1.03], [0.0, 0.97], [0.028, 0.95], [0.028, 0.0]])
    bars += [lathe(end, post, 12, 3) for end in ends]
    yield Part(joined(bars), textures.metal((1.0, 1.0), _IRON, rng))


def _ring(center: tuple[float, float, float], radius: float) -> Mesh:
    angle = np.linspace(0, 2 * np.pi, 15)
    circle = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=-1)
    return tube(np.asarray(center) + radius * circle, 0.006, 5)


def _pedestal(rng: np.random.Generator) -> Iterator[Part]:
    profile = np.array(
        [[0.0, 0.8], [0.34, 0.8], [0.36, 0.77], [0.36, 0.71], [0.25, 0.66], [0.2, 0.58],
         [0.21, 0.3], [0.25, 0.2], [0.36, 0.15], [0.38, 0.12], [0.38, 0.0]]
    )  # fmt: skip
    column = lathe((0, 0, 0.16), profile, 40, 3)
    yield Part(column, textures.earthenware((2.2, 1.0), "#c8bca4", rng))
    yield from _block((-0.55, -0.55, 0), (0.55, 0.55, 0.16), "#a89a84", rng)


def _vase(rng: np.random.Generator) -> Part:
    profile = np.array(
        [[0.10, 0.70], [0.135, 0.72], [0.14, 0.70], [0.10, 0.63], [0.12, 0.56], [0.24, 0.43],
         [0.285, 0.3], [0.25, 0.16], [0.16, 0.06], [0.15, 0.03], [0.17, 0.0]]
    )  # fmt: skip
    return Part(lathe((0, 0, 0.955), profile, 56, 5), textures.glaze(rng), glossy=True)


def _potted_plant(rng: np.random.Generator) -> Iterator[Part]:
    foot = np.array([-1.05, -0.85, 0.0])
    profile = np.array(
        [[0.0, 0.36], [0.2, 0.37], [0.21, 0.42], [0.25, 0.42], [0.25, 0.35], [0.225, 0.34],
         [0.15, 0.0]]
    )  # fmt: skip
    yield Part(lathe(foot, profile, 32, 2), textures.earthenware((1.4, 0.5), "#b8673f", rng))
    stems, leaves = [], []
    for turn in np.arange(16) * 2.4:
        reach, rise = rng.uniform(0.15, 0.5), rng.uniform(0.45, 0.95)
        s = np.linspace(0, 1, 9)[:, None]
        outward = np.array([np.cos(turn), np.sin(turn), 0])
        stem = foot + [0, 0, 0.36] + 0.06 * outward + reach * s**2 * outward
        stem = stem + [0, 0, 1] * (rise * (s - 0.3 * s**3))
        stems.append(tube(stem, 0.007, 5))
        leaves += _leaves_along(stem, rng)
    yield Part(joined(stems), textures.metal((0.2, 0.2), "#4d6b2e", rng), translucent=True)
    yield from _foliage(leaves, ("#5e8f32", "#3f7a34", "#88a83a"), rng)


def _leaves_along(stem: Float[np.ndarray, "points 3"], rng: np.random.Generator) -> list[Mesh]:
    leaves = []
    for at in range(2, len(stem)):
        tangent = unit(stem[at] - stem[at - 1])
        for _ in range(2 if at < len(stem) - 1 else 3):
            sideways = unit(rng.standard_normal(3) * [1, 1, 0.3])
            along = unit(0.7 * sideways + 0.5 * tangent + [0, 0, 0.1])
            length = rng.uniform(0.11, 0.2)
            leaves.append(leaf(stem[at], along, (0, 0, 1), length, 0.5 * length))
    return leaves


def _ivy(rng: np.random.Generator) -> Iterator[Part]:
    stems, leaves = [], []
    for start in np.linspace(-1.2, 2.7, 9):
        steps = rng.normal([0.0, 0.11], [0.09, 0.05], (24, 2)).cumsum(axis=0)
        height = np.clip(0.02 + np.abs(steps[:, 1]), 0, 2.45)
        along = np.clip(start + steps[:, 0], FRONT, BACK - 0.05)
        stem = np.stack([np.full(24, RIGHT - 0.025), along, height], axis=-1)
        stems.append(tube(stem, 0.008, 5))
        leaves += [leaf_ for point in stem for leaf_ in _ivy_leaves(point, rng)]
    yield Part(joined(stems), textures.metal((0.3, 0.3), "#5a4630", rng))
    yield from _foliage(leaves, ("#3e6a30", "#567f36", "#7a3b2a", "#2f5a33"), rng)


def _ivy_leaves(point: Float[np.ndarray, " 3"], rng: np.random.Generator) -> Iterator[Mesh]:
    for _ in range(2):
        offset = rng.uniform([-0.09, -0.12, -0.1], [-0.02, 0.12, 0.1])
        along = unit(np.array([-0.25, rng.normal(0, 0.6), -0.8]))
        facing = (-1.0, rng.normal(0, 0.3), 0.4 + rng.normal(0, 0.3))
        length = rng.uniform(0.09, 0.17)
        yield leaf(point + offset, along, facing, length, 0.85 * length)


def _foliage(
    leaves: list[Mesh], colors: tuple[str, ...], rng: np.random.Generator
) -> Iterator[Part]:
    """Returns the leaves in several greens, one part a color."""
    color = rng.integers(len(colors), size=len(leaves))
    for index, name in enumerate(colors):
        chosen = [one for one, c in zip(leaves, color, strict=True) if c == index]
        yield Part(joined(chosen), textures.foliage(name, rng), translucent=True)
