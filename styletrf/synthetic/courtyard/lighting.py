"""Daylight that reaches points of the courtyard: a sun with soft shadows, the sky, and the walls.

Irradiance is divided by pi, so that light times albedo is the color that is sent back:
`sun * cos * (part of the sun seen) + mean over the cosine-weighted hemisphere of sky or wall`.
"""

from collections.abc import Callable
from typing import no_type_check

import numpy as np
from jaxtyping import Float

from styletrf.synthetic.courtyard.mesh import unit
from styletrf.synthetic.courtyard.rays import Hierarchy, first_hit, in_threads, kernel, new_stack
from styletrf.synthetic.courtyard.shading import SUN, sky

SUN_COLOR = np.array([2.7, 2.3, 1.75])
WALL_COLOR = np.array([0.30, 0.25, 0.20])
_SUN_RADIUS = 0.02  # radians, a few times the real one, for softer shadows
_SUN_SAMPLES = 12
_SKY_SAMPLES = 48
_OFF_SURFACE = 2e-3  # meters
_POINTS_PER_TASK = 4096

Points = Float[np.ndarray, "points 3"]
Directions = Float[np.ndarray, "directions 3"]


def sunlight(tree: Hierarchy, points: Points, normals: Points) -> Points:
    """Returns the sun's light at points, with soft shadows."""
    directions = _around(SUN, _SUN_RADIUS * _sunflower(_SUN_SAMPLES))
    seen = _in_tasks(_part_of_sun, tree, points, normals, directions)
    return np.asarray(np.maximum(normals @ SUN, 0)[:, None] * seen * SUN_COLOR)


def skylight(tree: Hierarchy, points: Points, normals: Points) -> Points:
    """Returns the light of the sky and of the walls at points."""
    disc = _sunflower(_SKY_SAMPLES)
    height = np.sqrt(1 - (disc**2).sum(axis=1, keepdims=True))
    return _in_tasks(_part_of_sky, tree, points, normals, np.hstack([disc, height]))


def _sunflower(n: int) -> Float[np.ndarray, "n 2"]:
    """Returns n points spread evenly over the unit disc (Vogel's spiral)."""
    index = np.arange(n)
    angle = index * np.pi * (3 - np.sqrt(5))
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return np.asarray(np.sqrt((index + 0.5) / n)[:, None] * circle)


def _around(
    axis: Float[np.ndarray, " 3"], offsets: Float[np.ndarray, "directions 2"]
) -> Directions:
    across = unit(np.cross(axis, [0.0, 0.0, 1.0]))
    return unit(axis + offsets @ np.stack([across, np.cross(axis, across)]))


def _in_tasks(
    task: Callable[..., None], tree: Hierarchy, points: Points, normals: Points, samples: Directions
) -> Points:
    """Returns a kernel's output for all points, its work divided among threads."""
    result = np.empty_like(points)
    parts = [slice(i, i + _POINTS_PER_TASK) for i in range(0, len(points), _POINTS_PER_TASK)]
    lifted = points + _OFF_SURFACE * normals
    list(in_threads(lambda p: task(tree, lifted[p], normals[p], samples, result[p]), parts))
    return result


@no_type_check
@kernel
def _part_of_sun(tree, points, normals, directions, result):
    stack = new_stack()
    for i in range(len(points)):
        x, y, z = points[i]
        seen = 0
        for dx, dy, dz in directions:
            if dx * normals[i, 0] + dy * normals[i, 1] + dz * normals[i, 2] > 0:
                hit = first_hit(tree, stack, x, y, z, dx, dy, dz, any_hit=True)
                seen += hit[1] < 0
        result[i] = seen / len(directions)


@no_type_check
@kernel
def _part_of_sky(tree, points, normals, local, result):
    stack = new_stack()
    for i in range(len(points)):
        x, y, z = points[i]
        nx, ny, nz = normals[i]
        # An orthonormal basis around the normal (Duff et al. 2017).
        sign = 1.0 if nz >= 0 else -1.0
        p = -1.0 / (sign + nz)
        q = nx * ny * p
        result[i] = 0.0
        for a, b, c in local:
            dx = a * (1.0 + sign * nx * nx * p) + b * q + c * nx
            dy = a * sign * q + b * (sign + ny * ny * p) + c * ny
            dz = -a * sign * nx - b * ny + c * nz
            hit = first_hit(tree, stack, x, y, z, dx, dy, dz, any_hit=True)
            light = sky(dz) if hit[1] < 0 else (WALL_COLOR[0], WALL_COLOR[1], WALL_COLOR[2])
            for channel in range(3):
                result[i, channel] += light[channel] / len(local)
