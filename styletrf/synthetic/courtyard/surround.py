"""The surroundings of the courtyard on a walkthrough: houses, a tower, hills.

Over walls of two to three meters one sees houses at 15 to 60 m, a tower, and hills at 300 and
700 m; above them is the sky.
"""

from collections.abc import Iterator

import numpy as np

from styletrf.synthetic.courtyard import textures
from styletrf.synthetic.courtyard.mesh import Mesh, box, grid_triangles, joined
from styletrf.synthetic.courtyard.scene import Part

_HOUSES = 14
_COLORS = ("#d9c39a", "#c98f6b", "#e3d6bd", "#b7a58c", "#caa36f")


def surround_parts(seed: int) -> list[Part]:
    """Returns everything beyond the walls."""
    rng = np.random.default_rng([seed, 2023])
    return [*_houses(rng), _tower(rng), *_hills(rng)]


def _houses(rng: np.random.Generator) -> Iterator[Part]:
    for k in range(_HOUSES):
        angle = 2 * np.pi * (k + rng.uniform(-0.3, 0.3)) / _HOUSES
        distance, wide, high = rng.uniform([16, 6, 7], [60, 11, 12])
        x, y = distance * np.cos(angle), distance * np.sin(angle)
        high *= max(1.0, distance / 25)
        walls = joined(box((x - wide / 2, y - wide / 2, 0), (x + wide / 2, y + wide / 2, high)))
        if k % 2:
            texture = textures.masonry((wide / 2, high / 2), textures.BRICK, rng)
        else:
            color = _COLORS[int(rng.integers(len(_COLORS)))]
            texture = textures.plaster((wide / 2, high / 2), color, rng, worn=0.8)
        yield Part(walls, texture)


def _tower(rng: np.random.Generator) -> Part:
    walls = joined(box((-10.0, 26.0, 0), (-5.5, 30.5, 21.0)))
    return Part(walls, textures.masonry((4.5, 10.0), textures.RUBBLE, rng))


def _hills(rng: np.random.Generator) -> Iterator[Part]:
    for distance, high, color in ((300.0, 70.0, "#6f8a4f"), (700.0, 220.0, "#7d8f93")):
        texture = textures.plaster((30.0, 3.0), color, rng, worn=0.6)
        yield Part(_ridge(distance, high, rng), texture)


def _ridge(distance: float, high: float, rng: np.random.Generator, columns: int = 180) -> Mesh:
    """Returns a closed ridge around the origin, its crest between 0.4 and 1 of `high` (meters)."""
    angle = np.linspace(0, 2 * np.pi, columns + 1)
    crest = sum(
        rng.uniform(0.3, 1) / n * np.sin(n * angle + rng.uniform(0, 2 * np.pi))
        for n in range(1, 12)
    )
    crest = high * (0.7 + 0.3 * crest / np.abs(crest).max())
    rows = np.linspace(1, 0, 5)  # top first: triangles then face inwards
    z = rows[:, None] * crest
    radius = distance * (0.8 + 0.2 * rows[:, None]) + 0 * z
    inward = np.stack([-np.cos(angle), -np.sin(angle), np.ones_like(angle)], axis=-1) / np.sqrt(2)
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)
    normals = np.broadcast_to(inward, vertices.shape)
    u, v = np.meshgrid(angle / (2 * np.pi), 1 - rows)
    uv = np.stack([u, v], axis=-1)
    triangles = grid_triangles(len(rows), columns + 1)[:, ::-1]
    return Mesh(vertices.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), triangles)
