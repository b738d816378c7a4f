"""A mesh of the surfaces that cameras see.

Depths of all views are fused as truncated signed distances on a lattice of the field's grid
(Curless and Levoy 1996), whose zero is meshed by marching cubes (Lewiner et al. 2003, in
scikit-image). In the grid's coordinates all spaces are alike; vertices go to the world at the end.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module

import numpy as np
from jaxtyping import Bool, Float, Int64, Integer

from styletrf.errors import InputError
from styletrf.field.rendering import Rendering
from styletrf.geometry.cameras import Camera, depth_behind

ToWorld = Callable[[Float[np.ndarray, "points 3"]], Float[np.ndarray, "points 3"]]
_TRUNCATION_CELLS = 3.0
_BEHIND = 1.25  # times the depth, up to which the inside reaches: far cells are long
_DEFINITE = 0.05  # of the depth, by which its mean and its median may differ on a surface
_SEEN = 1e-3  # opacity, below which a pixel shows the background alone
_VISIBLE = 0.02  # of the depth, by which a vertex may lie behind the surface that a view sees


@dataclass(frozen=True, slots=True)
class SurfaceMesh:
    """Triangles, counterclockwise as seen from outside.

    Attributes:
        vertices: In the world.
        triangles: Indices of vertices.
    """

    vertices: Float[np.ndarray, "vertices 3"]
    triangles: Int64[np.ndarray, "triangles 3"]


def surface_fraction(renders: Sequence[Rendering]) -> float:
    """Returns the fraction of pixels with a definite surface, of those that show anything.

    There the median depth is finite, and the mean depth within 5 % of it. It is 0 where
    none shows anything.
    """
    definite, shown = 0, 0
    for render in renders:
        median, mean = render.median_depth.numpy(), render.depth.numpy()
        finite = np.isfinite(median) & np.isfinite(mean)
        apart = np.abs(mean[finite] - median[finite])
        definite += int((apart < _DEFINITE * median[finite]).sum())
        shown += int((render.opacity.numpy() >= _SEEN).sum())
    return definite / max(shown, 1)


def surface_mesh(
    cameras: Sequence[Camera],
    renders: Sequence[Rendering],
    to_world: ToWorld,
    resolution: tuple[int, int, int],
) -> SurfaceMesh:
    """Returns the mesh of the median depths.

    Args:
        cameras: The cameras of the renders.
        renders: The renders, with depths.
        to_world: The map from coordinates of the grid, [-1, 1]^3, to the cameras' world; NaN where
            no point of the world is mapped.
        resolution: The resolution of the lattice.

    Raises:
        InputError: No two neighbors of the lattice lie on different sides of a surface.
    """
    lattice = np.stack(np.meshgrid(*map(_centers, resolution), indexing="ij"), axis=-1)
    points_world = to_world(lattice.reshape(-1, 3)).reshape(lattice.shape)
    distances, known = _fused(cameras, renders, points_world)
    corners, triangles = _marched(distances, _inner(known))
    grid = (corners + 0.5) * (2 / np.array(resolution)) - 1
    vertices = to_world(grid.astype(np.float64))
    finite = np.isfinite(vertices[triangles]).all(axis=(1, 2))
    if not finite.any():
        raise _no_surface()
    used, triangles = np.unique(triangles[finite], return_inverse=True)
    triangles = triangles.reshape(-1, 3).astype(np.int64)
    outward = triangles[:, ::-1].copy() if _is_mirrored(points_world) else triangles
    return SurfaceMesh(vertices[used], outward)


def vertex_colors(
    mesh: SurfaceMesh,
    cameras: Sequence[Camera],
    depths: Iterable[Float[np.ndarray, "_ _"]],
    pictures: Iterable[Float[np.ndarray, "_ _ 3"]],
) -> Float[np.ndarray, "vertices 3"]:
    """Returns the mean color of each vertex in the views that see it, gray where none does."""
    sums = np.full((len(mesh.vertices), 4), 1e-3)
    sums[:, :3] *= 0.5
    for camera, depth, picture in zip(cameras, depths, pictures, strict=True):
        pixels, own, seen, inside = depth_behind(camera, depth, mesh.vertices)
        visible = np.flatnonzero(inside & (np.abs(own - seen) < _VISIBLE * own))
        column, row = np.floor(pixels[visible]).astype(int).T
        sums[visible, :3] += picture[row, column]
        sums[visible, 3] += 1
    colors: Float[np.ndarray, "vertices 3"] = sums[:, :3] / sums[:, 3:]
    return colors


def lattice_within(resolution: tuple[int, int, int], most_points: int) -> tuple[int, int, int]:
    """Returns the lattice with the same proportions that has at most so many points."""
    fraction = min(1.0, (most_points / np.prod(resolution, dtype=np.float64)) ** (1 / 3))
    x, y, z = (max(2, int(side * fraction)) for side in resolution)
    return x, y, z


def _centers(cells: int) -> Float[np.ndarray, " cells"]:
    return (np.arange(cells) + 0.5) * (2 / cells) - 1


def _fused(
    cameras: Sequence[Camera],
    renders: Sequence[Rendering],
    points_world: Float[np.ndarray, "x y z 3"],
) -> tuple[Float[np.ndarray, "x y z"], Bool[np.ndarray, "x y z"]]:
    """Returns mean distances in [-1, 1], positive in front of surfaces, and where any is known."""
    reach = _TRUNCATION_CELLS * _cell_lengths(points_world).ravel()
    points = points_world.reshape(-1, 3)
    there = np.flatnonzero(np.isfinite(points).all(axis=1) & np.isfinite(reach))
    points, reach = points[there], reach[there]
    sums, counts = np.zeros(len(points)), np.zeros(len(points))
    for camera, render in zip(cameras, renders, strict=True):
        _, own, seen, inside = depth_behind(camera, render.median_depth.numpy(), points)
        ahead = np.where(inside, (seen - own) / reach, -np.inf)
        near = (ahead > -1) & (own < _BEHIND * seen)
        sums[near] += np.minimum(ahead[near], 1.0)
        counts[near] += 1
    distances = np.ones(points_world.shape[:3])
    known = np.zeros(points_world.shape[:3], dtype=bool)
    distances.ravel()[there] = np.where(counts > 0, sums / np.maximum(counts, 1), 1.0)
    known.ravel()[there] = counts > 0
    return distances, known


def _marched(
    distances: Float[np.ndarray, "x y z"], inner: Bool[np.ndarray, "x y z"]
) -> tuple[Float[np.ndarray, "vertices 3"], Integer[np.ndarray, "triangles 3"]]:
    """Returns the zero of the distances within a part of the lattice, in units of its cells."""
    measure = import_module("skimage.measure")
    try:
        corners, triangles, _, _ = measure.marching_cubes(
            distances, 0.0, mask=inner, gradient_direction="descent"
        )
    except (RuntimeError, ValueError) as error:  # none inside, or no distance below 0
        raise _no_surface() from error
    return corners, triangles


def _no_surface() -> InputError:
    problem = "has no surface: no ray is stopped within its grid"
    return InputError("the field", problem, "Export points or ply instead of mesh")


def _inner(known: Bool[np.ndarray, "x y z"]) -> Bool[np.ndarray, "x y z"]:
    """Returns the known points whose 26 neighbors are known, too: the unknown has no surface."""
    inner = known.copy()
    for axis in range(3):
        before, found = np.moveaxis(inner.copy(), axis, 0), np.moveaxis(inner, axis, 0)
        found[1:] &= before[:-1]
        found[:-1] &= before[1:]
    return inner


def _is_mirrored(points_world: Float[np.ndarray, "x y z 3"]) -> bool:
    """Returns whether the map to the world makes right hands left ones."""
    axes = np.stack([np.gradient(points_world, axis=axis) for axis in range(3)], axis=-1)
    there = np.isfinite(axes).all(axis=(-1, -2))
    return bool(np.median(np.sign(np.linalg.det(axes[there]))) < 0)


def _cell_lengths(points_world: Float[np.ndarray, "x y z 3"]) -> Float[np.ndarray, "x y z"]:
    """Returns the length of each cell in the world, along its longest side."""
    lengths = [np.linalg.norm(np.gradient(points_world, axis=axis), axis=-1) for axis in range(3)]
    longest: Float[np.ndarray, "x y z"] = np.max(lengths, axis=0)
    return longest
