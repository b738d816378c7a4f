"""Triangle meshes and the few solids the courtyard is built of.

World: meters, x to the right, y into the scene, z up. Triangles wind counter-clockwise seen from
outside; texture coordinates (u, v) are in [0, 1], v downwards as in an image.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles that share one texture."""

    vertices: Float[np.ndarray, "vertices 3"]
    normals: Float[np.ndarray, "vertices 3"]
    uv: Float[np.ndarray, "vertices 2"]
    triangles: Int[np.ndarray, "triangles 3"]


Vector = Sequence[float | int] | Float[np.ndarray, " 3"]


def unit(vectors: Float[np.ndarray, "*shape 3"]) -> Float[np.ndarray, "*shape 3"]:
    """Returns the vectors at length one."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Returns the meshes as one."""
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.uv for mesh in meshes]),
        np.concatenate([mesh.triangles + s for mesh, s in zip(meshes, starts, strict=True)]),
    )


def panel(corner: Vector, along_u: Vector, along_v: Vector) -> Mesh:
    """Returns a parallelogram whose outside is where `along_v` x `along_u` points."""
    origin, u, v = (np.asarray(a, dtype=np.float64) for a in (corner, along_u, along_v))
    vertices = np.stack([origin, origin + u, origin + u + v, origin + v])
    normals = np.tile(unit(np.cross(v, u)), (4, 1))
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float64)
    return Mesh(vertices, normals, uv, np.array([[0, 2, 1], [0, 3, 2]]))


def box(low: Vector, high: Vector) -> list[Mesh]:
    """Returns the five visible sides of an upright box (it has no bottom)."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    dx, dy, dz = x1 - x0, y1 - y0, z1 - z0
    return [
        panel((x0, y0, z1), (dx, 0, 0), (0, 0, -dz)),
        panel((x1, y1, z1), (-dx, 0, 0), (0, 0, -dz)),
        panel((x0, y1, z1), (0, -dy, 0), (0, 0, -dz)),
        panel((x1, y0, z1), (0, dy, 0), (0, 0, -dz)),
        panel((x0, y1, z1), (dx, 0, 0), (0, -dy, 0)),
    ]


def grid_triangles(rows: int, columns: int) -> Int[np.ndarray, "triangles 3"]:
    """Returns two triangles for each cell of a lattice of rows x columns vertices."""
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    cells = np.stack([a, c, b, a, d, c], axis=-1)
    return cells.reshape(-1, 3)


def tube(path: Float[np.ndarray, "points 3"], radius: float, sides: int = 7) -> Mesh:
    """Returns an open tube of one radius (meters) along a path."""
    tangents = unit(np.gradient(path, axis=0))
    helper = np.where(np.abs(tangents[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    across = unit(np.cross(tangents, helper))
    binormal = np.cross(tangents, across)
    angle = np.linspace(0, 2 * np.pi, sides + 1)[None, :, None]
    normals = np.cos(angle) * across[:, None] + np.sin(angle) * binormal[:, None]
    vertices = path[:, None] + radius * normals
    u, v = np.meshgrid(np.linspace(0, 1, sides + 1), np.linspace(0, 1, len(path)))
    uv = np.stack([u, v], axis=-1).reshape(-1, 2)
    triangles = grid_triangles(len(path), sides + 1)
    return Mesh(vertices.reshape(-1, 3), normals.reshape(-1, 3), uv, triangles)


def rod(start: Vector, end: Vector, radius: float, pieces: int = 6, sides: int = 7) -> Mesh:
    """Returns a straight tube, cut into pieces so that light can vary along it."""
    s = np.linspace(0, 1, pieces + 1)[:, None]
    return tube((1 - s) * np.asarray(start) + s * np.asarray(end), radius, sides)


def lathe(
    center: Vector, profile: Float[np.ndarray, "points 2"], sides: int = 40, smooth: int = 1
) -> Mesh:
    """Returns the solid of revolution of (radius, height) points, top first, about a vertical axis.

    With `smooth` above 1 the profile is resampled by that factor along a Catmull-Rom spline.
    """
    curve = _catmull_rom(profile, smooth) if smooth > 1 else profile
    slope = np.gradient(curve, axis=0)
    # Turning the downward tangent of the profile by 90 degrees gives its outward normal.
    outward = unit(np.stack([-slope[:, 1], slope[:, 0], np.zeros(len(curve))], axis=-1))
    length = np.linalg.norm(np.diff(curve, axis=0), axis=1).cumsum()
    along = np.concatenate([[0.0], length / length[-1]])
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)[None]
    vertices, normals = (
        np.concatenate(
            [a[:, None, :1] * ring, np.broadcast_to(a[:, None, 1:2], (len(a), sides + 1, 1))],
            axis=-1,
        )
        for a in (curve, outward)
    )
    u, v = np.meshgrid(np.linspace(0, 1, sides + 1), along)
    return Mesh(
        vertices.reshape(-1, 3) + np.asarray(center, dtype=np.float64),
        normals.reshape(-1, 3),
        np.stack([u, v], axis=-1).reshape(-1, 2),
        grid_triangles(len(curve), sides + 1),
    )


def _catmull_rom(points: Float[np.ndarray, "points d"], factor: int) -> Float[np.ndarray, "more d"]:
    padded = np.concatenate([2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]])
    p0, p1, p2, p3 = padded[:-3], padded[1:-2], padded[2:-1], padded[3:]
    t = (np.arange(factor) / factor)[:, None, None]
    linear, square = p2 - p0, 2 * p0 - 5 * p1 + 4 * p2 - p3
    cube = -p0 + 3 * p1 - 3 * p2 + p3
    curve = 0.5 * (2 * p1 + linear * t + square * t**2 + cube * t**3)
    dense = curve.transpose(1, 0, 2).reshape(-1, points.shape[1])
    return np.concatenate([dense, points[-1:]])


_LEAF_OUTLINE = np.array(
    [
        [0, 0],
        [0.42, 0.22],
        [0.5, 0.48],
        [0.3, 0.78],
        [0, 1],
        [-0.3, 0.78],
        [-0.5, 0.48],
        [-0.42, 0.22],
    ]
)


def leaf(stalk: Vector, along: Vector, facing: Vector, length: float, width: float) -> Mesh:
    """Returns a leaf folded a little along its midrib, from `stalk` in direction `along`."""
    forward = unit(np.asarray(along, dtype=np.float64))
    side = unit(np.cross(forward, np.asarray(facing, dtype=np.float64)))
    up = np.cross(side, forward)
    x, y = _LEAF_OUTLINE[:, :1], _LEAF_OUTLINE[:, 1:]
    outline = x * width * side + y * length * forward + np.abs(x) * 0.35 * width * up
    droop = -0.18 * length * y**2 * up
    vertices = np.asarray(stalk) + np.concatenate([outline + droop, outline[4:5] * 0.5])
    uv = np.concatenate([_LEAF_OUTLINE + np.array([0.5, 0.0]), [[0.5, 0.5]]])
    around = np.arange(8)
    triangles = np.stack([np.full(8, 8), around, (around + 1) % 8], axis=-1)
    return Mesh(vertices, np.tile(up, (9, 1)), uv, triangles)
