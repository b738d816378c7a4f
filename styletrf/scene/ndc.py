"""NDC: the frustum that holds all views of a forward-facing capture, from near to infinity.

All lengths are in units of the near points' depth, along the mean view.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from styletrf.errors import InputError
from styletrf.geometry.cameras import Camera, fitted_to, moved
from styletrf.geometry.space import Space
from styletrf.geometry.typical_view import typical_view
from styletrf.scene.placement import INFINITY_PX, Placement, facing_frame, transformed

Plane = Float[np.ndarray, " 2"]

MAX_STRETCH = 2.5  # of the frustum over one view: beyond, most of the lattice holds nothing sharp
MIN_CORNER_DEPTH = 0.1  # of a ray's unit of depth, along the mean view: less looks sideways
MIN_CLEARANCE = 1.05  # nearest points over the foremost camera's depth


def forward_facing_evidence(
    cameras: Sequence[Camera], points_world: Float[np.ndarray, "points 3"]
) -> dict[str, Any]:
    """Returns whether one frustum holds the capture, with the quantities that say so.

    `stretch` is the frustum's extent over that of one view (none where a view has corners that
    look sideways); `near_point_clearance` is (nearest point depth - rearmost camera) over
    (foremost - rearmost camera), so 1 is a point beside the foremost camera.
    """
    normalized_from_world = _normalized_from_world(cameras, points_world)
    views = [moved(camera, normalized_from_world) for camera in cameras]
    corner_depth = min(float(_corners(view)[:, 2].min()) for view in views)
    stretch = _stretch(views) if corner_depth > MIN_CORNER_DEPTH else None
    clearance = _clearance(views, transformed(normalized_from_world, points_world)[:, 2])
    return {
        "forward_facing": stretch is not None
        and stretch <= MAX_STRETCH
        and clearance >= MIN_CLEARANCE,
        "stretch": stretch,
        "stretch_threshold": MAX_STRETCH,
        "least_corner_depth": corner_depth,
        "corner_depth_threshold": MIN_CORNER_DEPTH,
        "near_point_clearance": clearance,
        "clearance_threshold": MIN_CLEARANCE,
    }


def place_in_ndc(
    cameras: Sequence[Camera],
    points_world: Float[np.ndarray, "points 3"],
    image_long_side: int,
    oversampling: float,
) -> Placement:
    """Returns the frustum that holds every view.

    Raises:
        InputError: No frustum does, or it would hold no point.
    """
    normalized_from_world = _normalized_from_world(cameras, points_world)
    views = [moved(fitted_to(c, image_long_side), normalized_from_world) for c in cameras]
    depths = transformed(normalized_from_world, points_world)[:, 2]
    plane = _plane(views)
    ahead = depths[depths > plane]
    if not len(ahead) or min(_corners(view)[:, 2].min() for view in views) <= MIN_CORNER_DEPTH:
        raise InputError(
            "space 'ndc'", "the views do not look one way, at points before all of them",
            "Leave the space to the evidence, or set it to 'box'",
        )  # fmt: skip
    lower, upper = _tangent_bounds(views)
    typical = typical_view(views)
    parallax_px = float(typical.fx) * _baseline(views)  # of a point at unit depth
    farthest = float(np.percentile(ahead, 99.5))
    far = max(parallax_px / INFINITY_PX, 10 * farthest)
    disparity_px = parallax_px * (1 / plane - 1 / float(np.percentile(ahead, 99)))
    across = oversampling * np.array([typical.fx, typical.fy]) * (upper - lower)
    near_far = {
        "nearest_points_normalized": float(np.percentile(ahead, 0.5)),
        "farthest_points_normalized": farthest,
        "plane_normalized": plane,
        "infinity_normalized": far,
        "disparity_range_px": disparity_px,
    }
    return Placement(
        space=Space(
            "ndc", _frustum(lower, upper, plane, far)[None], (1.0, 1.0, 1.0), depth_min=0.0
        ),
        normalized_from_world=normalized_from_world,
        resolution=(float(across[0]), float(across[1]), 0.5 * disparity_px),
        focus=(0.0, 0.0, float(1 / np.mean(1 / ahead))),
        looking="ahead",
        evidence={"near_far": near_far},
    )


def _normalized_from_world(
    cameras: Sequence[Camera], points_world: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, "4 4"]:
    """Returns a similarity: z the mean view, y the mean down, unit the near depth less a tenth."""
    frame = facing_frame(cameras)
    depths = transformed(frame, points_world)[:, 2]
    ahead = depths[depths > 0]
    near = 0.9 * float(np.percentile(ahead if len(ahead) else np.abs(depths), 0.5))
    scaled: Float[np.ndarray, "4 4"] = np.diag([1 / near, 1 / near, 1 / near, 1.0]) @ frame
    return scaled


def _plane(views: Sequence[Camera]) -> float:
    """Returns where the frustum begins: before the near points and in front of all cameras."""
    return max(0.9, 1.02 * max(float(view.center_world[2]) for view in views))


def _clearance(views: Sequence[Camera], depths: Float[np.ndarray, " points"]) -> float:
    along = [float(view.center_world[2]) for view in views]
    near, rear = float(np.percentile(depths, 1)), min(along)
    extent = max(max(along) - rear, 1e-9)
    return float(np.clip((near - rear) / extent, -1e6, 1e6))


def _baseline(views: Sequence[Camera]) -> float:
    """Returns the larger extent of the centers across the view."""
    return float(np.ptp([view.center_world for view in views], axis=0)[:2].max())


def _stretch(views: Sequence[Camera]) -> float:
    lower, upper = _tangent_bounds(views)
    view = np.median([(view.width / view.fx, view.height / view.fy) for view in views], axis=0)
    return float(((upper - lower) / view).max())


def _corners(view: Camera) -> Float[np.ndarray, "4 3"]:
    """Returns the directions through the corners of the image, with z = 1 in the camera."""
    x = (np.array([0, view.width]) - view.cx) / view.fx
    y = (np.array([0, view.height]) - view.cy) / view.fy
    directions = np.stack(np.meshgrid(x, y, [1.0]), axis=-1).reshape(4, 3)
    corners: Float[np.ndarray, "4 3"] = directions @ view.world_from_camera[:, :3].T
    return corners


def _tangent_bounds(views: Sequence[Camera]) -> tuple[Plane, Plane]:
    """Returns the extremes of x/z and y/z over all views, from the near points to infinity.

    Along a ray both are monotone in z: its two ends decide.
    """
    nearest = max(1.0, _plane(views))
    tangents = []
    for view in views:
        corners, center = _corners(view), view.center_world
        slopes = corners[:, :2] / corners[:, 2:]
        tangents += [slopes, (center[:2] + (nearest - center[2]) * slopes) / nearest]
    return np.min(np.concatenate(tangents), axis=0), np.max(np.concatenate(tangents), axis=0)


def _frustum(lower: Plane, upper: Plane, near: float, far: float) -> Float[np.ndarray, "4 4"]:
    """Returns the projective map of an off-center frustum along +z to [-1, 1]^3, near at -1."""
    matrix = np.zeros((4, 4))
    for axis in range(2):
        matrix[axis, axis] = 2 / (upper[axis] - lower[axis])
        matrix[axis, 2] = -(upper[axis] + lower[axis]) / (upper[axis] - lower[axis])
    matrix[2, 2] = (far + near) / (far - near)
    matrix[2, 3] = -2 * far * near / (far - near)
    matrix[3, 2] = 1.0
    return matrix
