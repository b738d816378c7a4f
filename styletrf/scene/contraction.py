"""Unbounded space in a grid: an inner box unchanged, and everything beyond it contracted.

Piecewise projective contraction (MERF, Reiser et al. 2023, section 4.1), made of projective maps so
that rays stay straight within each part. With y the coordinates in which the inner box is
[-1, 1]^3, and j the axis along which |y| is largest:

    |y| <= 1     g = INNER y
    beyond       g_i = INNER y_i / |y_j|  for i != j,   g_j = sign(y_j) (a - b / |y_j|)

a and b such that g_j is INNER at |y_j| = 1 and 1 at |y_j| = reach. Like the sides of a cube map,
the parts beyond the box lie apart in the grid: where two of them meet a ray leaps. A map's
homogeneous w is 1 or +-y_j: the map of a point is the one with the largest.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from styletrf.geometry.typical_view import typical_view
from styletrf.scene.box import box_around, whole_box
from styletrf.scene.placement import INFINITY_PX, Placement
from styletrf.scene.upright_capture import Extent, UprightCapture, looked_at, placed

INNER = 0.75  # of the grid's axes is the inner box
LOST = 3.0  # octaves that a point outside a box counts as
_PERCENT = 80.0  # of the points along each axis, that the inner box holds
_NEAREST, _MOST = 0.1, 0.5  # of the points: at least the subject's, and enough to show it
_FLATTEST = 0.5  # of the inner box's longest side is its shortest


def place_unbounded(scene: UprightCapture, oversampling: float) -> Placement:
    """Returns unbounded space around the inner box."""
    inner = inner_box(scene)
    maps = contraction(_reach(scene, inner))
    drawn_in = scene.footprints / np.maximum(_largest(scene, inner), 1)  # as the voxels are
    footprint = float(np.median(drawn_in))
    return placed(scene, inner, "unbounded", maps, INNER, oversampling, footprint)


def contraction(reach: float) -> Float[np.ndarray, "7 4 4"]:
    """Returns the maps to the grid from coordinates in which the inner box is [-1, 1]^3.

    Args:
        reach: The end of the grid, in halves of the inner box, more than 1.
    """
    b = (1 - INNER) / (1 - 1 / reach)
    maps = [np.diag([INNER, INNER, INNER, 1.0])]
    for axis in range(3):
        for sign in (1.0, -1.0):
            matrix = np.diag([INNER, INNER, INNER, 0.0])
            matrix[axis, axis], matrix[axis, 3] = INNER + b, -sign * b
            matrix[3, axis] = sign
            maps.append(matrix)
    return np.stack(maps)


def octaves_lost(scene: UprightCapture, voxels_in: Callable[[str], int]) -> dict[str, float]:
    """Returns by how much a lattice is coarser than the photographs, per space.

    This is the mean, over all points that a view may see, of log2 of the lattice's spacing there
    over the pixel's footprint, where it is coarser; a point outside the box counts as LOST.

    Args:
        scene: The photographs' cameras and points.
        voxels_in: Returns the voxels of the lattice in a space of a kind.
    """
    box, unbounded = voxels_in("box"), voxels_in("unbounded")
    return {
        "box": _lost(scene, whole_box(scene), box),
        "unbounded": _lost_around(scene, inner_box(scene), unbounded),
    }


def inner_box(scene: UprightCapture) -> Extent:
    """Returns the box with the finest voxels, none of its sides too short.

    The box holds most points and the cameras. Where cameras look inward, it holds their subject
    instead, which is nearer than they are. A wall that stands in a face of the box would be cut
    between two parts of the grid: hence the margin about the points.
    """
    held, points = np.stack([view.center_world for view in scene.views]), scene.points
    if looked_at(scene)[1] == "inward":
        held, points = _subject(scene)
    box = box_around(points, _PERCENT)
    held = np.concatenate([held, [box.center - box.half, box.center + box.half]])
    lower, upper = held.min(axis=0), held.max(axis=0)
    half = (upper - lower) / 2
    return Extent((lower + upper) / 2, np.maximum(half, _FLATTEST * half.max()))


def _subject(scene: UprightCapture) -> tuple[Float[np.ndarray, "2 3"], Float[np.ndarray, "n 3"]]:
    """Returns the subject of views that look inward: two corners of a cube, and points.

    The points are those no farther from the focus than the cameras, or at least the nearest: houses
    behind a statue would make its voxels as large as the statue. Where most points lie beyond, the
    subject may have few itself, as a smooth one has: there the cube about the focus fills the
    shorter side of the pictures. Elsewhere the cube is the focus alone.
    """
    focus, view = looked_at(scene)[0], typical_view(scene.views)
    centers = np.stack([each.center_world for each in scene.views])
    distance = float(np.median(np.linalg.norm(centers - focus, axis=1)))
    apart = np.linalg.norm(scene.points - focus, axis=1)
    is_near = apart <= max(distance, float(np.quantile(apart, _NEAREST)))
    half = distance * min(view.width / view.fx, view.height / view.fy) / 2
    size = half if is_near.mean() < _MOST else 0.0
    return focus + size * np.array([[-1.0], [1.0]]), scene.points[is_near]


def _lost(scene: UprightCapture, box: Extent, voxels: int) -> float:
    octaves = np.log2(np.maximum(_spacing(box, voxels) / scene.footprints, 1))
    return float(np.where(_largest(scene, box) <= 1, octaves, np.maximum(octaves, LOST)).mean())


def _lost_around(scene: UprightCapture, inner: Extent, voxels: int) -> float:
    spacing = _spacing(inner, voxels) / INNER * np.maximum(_largest(scene, inner), 1)
    return float(np.log2(np.maximum(spacing / scene.footprints, 1)).mean())


def _spacing(box: Extent, voxels: int) -> float:
    return float((8 * box.half.prod() / voxels) ** (1 / 3))


def _largest(scene: UprightCapture, box: Extent) -> Float[np.ndarray, " observations"]:
    """Returns the largest coordinate of the seen points, in halves of the box."""
    largest: Float[np.ndarray, " observations"] = np.abs(
        (scene.footprint_points - box.center) / box.half
    ).max(axis=1)
    return largest


def _reach(scene: UprightCapture, inner: Extent) -> float:
    """Returns where the grid ends: at no parallax, and ten times as far as the farthest points."""
    centers = np.stack([view.center_world for view in scene.views])
    focal_px = typical_view(scene.views).fx
    parallax_px = float(focal_px * np.ptp(centers, axis=0).max())  # at depth 1
    farthest = float(np.percentile(_largest(scene, inner), 99.5))
    return max(parallax_px / INFINITY_PX / float(inner.half.max()), 10 * farthest, 10.0)
