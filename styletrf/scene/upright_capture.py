"""A scene seen from several sides: upright, and looked at inward, outward or ahead.

A box and unbounded space share this: the frame in which both stand, how the photographers looked,
and the finest lattice that their views support.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from styletrf.errors import InputError
from styletrf.geometry.cameras import Camera, fitted_to, in_view, moved
from styletrf.geometry.space import Space
from styletrf.scene.placement import (
    Looking,
    Placement,
    Vector,
    facing_frame,
    frame_at_mean_center,
    mean_view,
    transformed,
    unit_square_to,
)

ROLL = 0.03  # radians by which a photographer's horizon is off level
MOST_VIEWS = 0.7  # that look at the focus, or away from it: fewer look along their way
_FACING = 0.5  # cosine to the focus
MIN_SPREAD_DEG = 10.0  # of the views, root mean square: below, it is no capture from all around


@dataclass(frozen=True, slots=True)
class Extent:
    """A box in the upright frame: its center and half its sides."""

    center: Vector
    half: Vector


@dataclass(frozen=True, slots=True)
class UprightCapture:
    """Cameras at the working size and points, both in the upright frame, in the world's unit.

    `footprints` are the sizes of a pixel at the points that each view may see, and
    `footprint_points` which points these are.
    """

    frame_from_world: Float[np.ndarray, "4 4"]
    views: Sequence[Camera]
    points: Float[np.ndarray, "points 3"]
    footprints: Float[np.ndarray, " observations"]
    footprint_points: Float[np.ndarray, "observations 3"]
    nearest: float  # depth of the nearest points of any view

    @property
    def pixel(self) -> float:
        """A pixel's median size at the points."""
        return float(np.median(self.footprints))


def upright_capture(
    cameras: Sequence[Camera], points_world: Float[np.ndarray, "points 3"], image_long_side: int
) -> UprightCapture:
    """Returns the capture in its upright frame.

    Raises:
        InputError: No photograph sees any of the points.
    """
    frame = upright_frame(cameras)
    views = [moved(fitted_to(camera, image_long_side), frame) for camera in cameras]
    points = transformed(frame, points_world)
    nearest, footprints, seen_points = [], [], []
    for view in views:
        _, depth, inside = in_view(view, points)
        if inside.any():
            nearest.append(float(np.percentile(depth[inside], 1)))
            footprints.append(depth[inside] / view.fx)
            seen_points.append(points[inside])
    if not footprints:
        raise InputError(
            "sparse points", "no photograph sees any of them", "Take more overlapping photographs"
        )
    return UprightCapture(
        frame, views, points, np.concatenate(footprints), np.concatenate(seen_points), min(nearest)
    )


def upright_frame(cameras: Sequence[Camera]) -> Float[np.ndarray, "4 4"]:
    """Returns frame_from_world, y down as the photographers stood, z near their mean view."""
    if _spread_deg(cameras) < MIN_SPREAD_DEG:
        return facing_frame(cameras)
    y = _down(cameras)
    return frame_at_mean_center(cameras, y, unit_square_to(y, mean_view(cameras)))


def placed(
    scene: UprightCapture, inner: Extent, kind: Literal["box", "unbounded"],
    grid_from_inner: Float[np.ndarray, "maps 4 4"], inner_fraction: float, oversampling: float,
    footprint: float,
) -> Placement:  # fmt: skip
    """Returns the scene scaled so that the longest half of the `inner` box is 1.

    Args:
        scene: The capture.
        inner: The box that the middle of a grid holds.
        kind: The kind of the space.
        grid_from_inner: The maps of the space from coordinates in which the inner box is [-1, 1]^3.
        inner_fraction: The fraction of the grid along each axis that the inner box takes.
        oversampling: Wanted lattice points per pixel, of the size of `footprint`.
        footprint: The size of a pixel in the inner box.
    """
    scale = float(1 / inner.half.max())
    half = inner.half * scale
    normalized_from_frame = np.diag([scale, scale, scale, 1.0])
    normalized_from_frame[:3, 3] = -scale * inner.center
    inner_from_normalized = np.diag([*(1 / half), 1.0])
    pixel, nearest = scale * footprint, scale * scene.nearest
    wanted = oversampling * 2 * half / inner_fraction / pixel
    focus, looking, evidence = looked_at(scene)
    focus = scale * (focus - inner.center)
    lengths = half / inner_fraction
    return Placement(
        space=Space(
            kind, grid_from_inner @ inner_from_normalized,
            (float(lengths[0]), float(lengths[1]), float(lengths[2])), depth_min=0.5 * nearest,
        ),
        normalized_from_world=normalized_from_frame @ scene.frame_from_world,
        resolution=(float(wanted[0]), float(wanted[1]), float(wanted[2])),
        focus=(float(focus[0]), float(focus[1]), float(focus[2])),
        looking=looking,
        evidence={
            "box": {"pixel_footprint_normalized": pixel, "half_extent": half.tolist()},
            "near_far": {"nearest_points_normalized": nearest},
            "looking": evidence,
        },
    )  # fmt: skip


def looked_at(scene: UprightCapture) -> tuple[Vector, Looking, dict[str, Any]]:
    """Returns the focus in the upright frame, how the views look at it, and the evidence."""
    views, spread_deg = scene.views, _spread_deg(scene.views)
    parallel = spread_deg < MIN_SPREAD_DEG
    focus = _point_ahead(views, scene.points) if parallel else nearest_to_axes(views)
    cosines = _cosines_to(focus, views)
    inward, outward = float((cosines > _FACING).mean()), float((cosines < -_FACING).mean())
    looking: Looking = "inward" if inward > outward else "outward"
    if max(inward, outward) < MOST_VIEWS:
        looking = "along"
    return focus, "ahead" if parallel else looking, {
        "spread_of_views_deg": spread_deg,
        "spread_threshold_deg": MIN_SPREAD_DEG,
        "median_cosine_of_view_to_focus": float(np.median(cosines)),
        "share_towards_focus": inward,
        "share_away_from_focus": outward,
        "share_threshold": MOST_VIEWS,
    }  # fmt: skip


def nearest_to_axes(cameras: Sequence[Camera]) -> Vector:
    """Returns the point with the least squared distance to all optical axes."""
    normal, right = 1e-6 * np.eye(3), np.zeros(3)
    for camera in cameras:
        across = np.eye(3) - np.outer(camera.forward_world, camera.forward_world)
        normal += across
        right += across @ camera.center_world
    focus: Vector = np.linalg.solve(normal, right)
    return focus


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


def _cosines_to(focus: Vector, views: Sequence[Camera]) -> Float[np.ndarray, " views"]:
    """Returns the cosines between the views and the directions to the focus."""
    to_focus = focus - np.stack([view.center_world for view in views])
    along = (to_focus * np.stack([view.forward_world for view in views])).sum(axis=1)
    cosines: Float[np.ndarray, " views"] = along / np.maximum(
        np.linalg.norm(to_focus, axis=1), 1e-12
    )
    return cosines
