"""Where an object must be, from its silhouettes (Laurentini 1994).

A point belongs to the visual hull when no view sees background there and most see the object. A
view that does not see a point does not exclude it.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from styletrf.box import nearest_to_axes
from styletrf.cameras import Camera, project
from styletrf.errors import InputError

Points = Float[np.ndarray, "points 3"]

_LATTICE = 96  # points along each axis, at each of two levels
_DIRECTIONS = 1024


def extremes_of_hull(
    cameras: Sequence[Camera], silhouettes: Sequence[Bool[np.ndarray, "height width"]]
) -> Points:
    """Returns the world points of the hull that are farthest in each of many directions.

    These are what a box has to hold, down to thin parts. The hull is taken from two lattices: the
    first reaches from the point nearest to all optical axes as far as the nearest camera, the
    second fills what the first left.

    Raises:
        InputError: The silhouettes have nothing in common.
    """
    center = nearest_to_axes(cameras)
    reach = min(float(np.linalg.norm(camera.center_world - center)) for camera in cameras)
    points = _carved(_lattice(center - reach, center + reach), cameras, silhouettes)
    margin = 2 * reach / (_LATTICE - 1)
    lattice = _lattice(points.min(axis=0) - margin, points.max(axis=0) + margin)
    hull = _carved(lattice, cameras, silhouettes)
    extremes: Points = hull[[int((hull @ direction).argmax()) for direction in _directions()]]
    return extremes


def _directions() -> Float[np.ndarray, "directions 3"]:
    """Returns unit vectors spread evenly, along a spiral of golden angles."""
    z = 1 - (2 * np.arange(_DIRECTIONS) + 1) / _DIRECTIONS
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(_DIRECTIONS)
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=-1)


def _lattice(lower: Float[np.ndarray, " 3"], upper: Float[np.ndarray, " 3"]) -> Points:
    axes = [np.linspace(low, high, _LATTICE) for low, high in zip(lower, upper, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def _carved(
    points: Points,
    cameras: Sequence[Camera],
    silhouettes: Sequence[Bool[np.ndarray, "height width"]],
) -> Float[np.ndarray, "kept 3"]:
    seen_by = np.zeros(len(points), np.int64)
    for camera, silhouette in zip(cameras, silhouettes, strict=True):
        seen, inside = _looked_up(camera, silhouette, points)
        keep = inside | ~seen
        points, seen_by = points[keep], seen_by[keep] + seen[keep]
    points = points[2 * seen_by > len(cameras)]
    if not len(points):
        problem = "have nothing in common"
        raise InputError("the silhouettes", problem, "Check the poses and the images' alpha")
    return points


def _looked_up(
    camera: Camera, silhouette: Bool[np.ndarray, "height width"], points: Points
) -> tuple[Bool[np.ndarray, " points"], Bool[np.ndarray, " points"]]:
    """Returns which points a view sees at all, and which of them within the silhouette."""
    pixels, depth = project(camera, points)
    seen = (depth > 0) & (pixels >= 0).all(axis=1)
    seen &= (pixels < [camera.width, camera.height]).all(axis=1)
    column, row = pixels[seen].astype(np.int64).T
    inside = np.zeros(len(points), dtype=bool)
    inside[seen] = silhouette[row, column]
    return seen, inside
