"""The box around a scene that is seen from several sides, upright."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from styletrf.cameras import Camera, fitted_to, moved, project
from styletrf.errors import InputError
from styletrf.placement import (
    Looking,
    Placement,
    Vector,
    facing_frame,
    frame_at_mean_center,
    mean_view,
    transformed,
    unit_square_to,
)
from styletrf.space import Space

ROLL = 0.03  # radians by which a photographer's horizon is off level
MIN_SPREAD_DEG = 10.0  # of the views, root mean square: below, it is no capture from all around


def place_in_box(
    cameras: Sequence[Camera],
    points_world: Float[np.ndarray, "points 3"],
    image_long_side: int,
    oversampling: float,
) -> Placement:
    """Returns a box around the points, scaled so that its longest half is 1."""
    spread_deg = _spread_deg(cameras)
    parallel = spread_deg < MIN_SPREAD_DEG
    frame = facing_frame(cameras) if parallel else _upright_frame(cameras)
    center, half, scale = _extent(transformed(frame, points_world))
    normalized_from_frame = np.diag([scale, scale, scale, 1.0])
    normalized_from_frame[:3, 3] = -scale * center
    normalized_from_world = normalized_from_frame @ frame
    half = half * scale
    views = [moved(fitted_to(c, image_long_side), normalized_from_world) for c in cameras]
    points = transformed(normalized_from_world, points_world)
    nearest, pixel = _near_and_pixel(views, points)
    wanted = oversampling * 2 * half / pixel
    focus = _point_ahead(views, points) if parallel else nearest_to_axes(views)
    cosine = _cosine_to(focus, views)
    looking: Looking = "ahead" if parallel else "inward" if cosine > 0 else "outward"
    axis_lengths = (float(half[0]), float(half[1]), float(half[2]))
    return Placement(
        space=Space("box", np.diag([*(1 / half), 1.0]), axis_lengths, depth_min=0.5 * nearest),
        normalized_from_world=normalized_from_world,
        wanted=(float(wanted[0]), float(wanted[1]), float(wanted[2])),
        focus=(float(focus[0]), float(focus[1]), float(focus[2])),
        looking=looking,
        evidence={
            "box": {"pixel_footprint_normalized": pixel, "half_extent": half.tolist()},
            "near_far": {"nearest_points_normalized": nearest},
            "looking": {
                "spread_of_views_deg": spread_deg,
                "spread_threshold_deg": MIN_SPREAD_DEG,
                "median_cosine_of_view_to_focus": cosine,
            },
        },
    )


def _extent(points: Float[np.ndarray, "points 3"]) -> tuple[Vector, Vector, float]:
    """Returns the box's centre and half extents, and the scale that makes the longest 1."""
    lower, upper = np.percentile(points, 1, axis=0), np.percentile(points, 99, axis=0)
    half = 1.15 * (upper - lower) / 2
    half = np.maximum(half, 0.02 * half.max())
    return (lower + upper) / 2, half, float(1 / half.max())


def nearest_to_axes(cameras: Sequence[Camera]) -> Vector:
    """Returns the point with the least squared distance to all optical axes."""
    normal, right = 1e-6 * np.eye(3), np.zeros(3)
    for camera in cameras:
        across = np.eye(3) - np.outer(camera.forward_world, camera.forward_world)
        normal += across
        right += across @ camera.center_world
    focus: Vector = np.linalg.solve(normal, right)
    return focus


def _upright_frame(cameras: Sequence[Camera]) -> Float[np.ndarray, "4 4"]:
    """Returns frame_from_world, y down as the photographers stood, z near their mean view."""
    y = _down(cameras)
    return frame_at_mean_center(cameras, y, unit_square_to(y, mean_view(cameras)))


def _down(cameras: Sequence[Camera]) -> Vector:
    """Returns the world's down: the mean of the images' down, square to the images' right.

    A camera that looks down tilts its own down forwards. Around a ring these tilts cancel; over an
    arc they do not, but there the images' right, which is level but for the roll, spans the
    horizontal.
    """
    right = np.stack([camera.world_from_camera[:, 0] for camera in cameras])
    down = np.mean([camera.world_from_camera[:, 1] for camera in cameras], axis=0)
    if np.linalg.norm(down) < 1e-3:  # as many stood on their heads
        down = cameras[0].world_from_camera[:, 1]
    level = right.T @ right / len(cameras) + ROLL**2 * np.eye(3)
    down = np.linalg.solve(level, down)
    unit: Vector = down / np.linalg.norm(down)
    return unit


def _spread_deg(cameras: Sequence[Camera]) -> float:
    """Returns the root mean square angle between the views and their mean."""
    cosines = np.stack([camera.forward_world for camera in cameras]) @ mean_view(cameras)
    return float(np.degrees(np.sqrt((np.arccos(np.clip(cosines, -1, 1)) ** 2).mean())))


def _point_ahead(views: Sequence[Camera], points: Float[np.ndarray, "points 3"]) -> Vector:
    """Returns a point along the mean view amid the points, or beyond them clear of all cameras."""
    z, centers = mean_view(views), np.stack([view.center_world for view in views])
    reach = float(np.linalg.norm(centers - centers.mean(axis=0), axis=1).max())
    depth = float(np.median((points - centers.mean(axis=0)) @ z))
    ahead: Vector = centers.mean(axis=0) + max(2 * reach, depth) * z
    return ahead


def _cosine_to(focus: Vector, views: Sequence[Camera]) -> float:
    """Returns the median cosine between the views and the directions to the focus."""
    to_focus = focus - np.stack([view.center_world for view in views])
    along = (to_focus * np.stack([view.forward_world for view in views])).sum(axis=1)
    return float(np.median(along / np.maximum(np.linalg.norm(to_focus, axis=1), 1e-12)))


def _near_and_pixel(
    views: Sequence[Camera], points: Float[np.ndarray, "points 3"]
) -> tuple[float, float]:
    """Returns the depth of the nearest points of any view, and a pixel's median size at points."""
    nearest, sizes = [], []
    for view in views:
        pixels, depth = project(view, points)
        inside = (depth > 0) & (pixels >= 0).all(axis=1)
        inside &= (pixels < np.array([view.width, view.height])).all(axis=1)
        if inside.any():
            nearest.append(float(np.percentile(depth[inside], 1)))
            sizes.append(depth[inside] / view.fx)
    if not sizes:
        raise InputError(
            "sparse points", "no photograph sees any of them", "Take more overlapping photographs"
        )
    return min(nearest), float(np.median(np.concatenate(sizes)))
