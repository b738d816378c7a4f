"""The placement of a scene in its space, which the box and NDC both return."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from styletrf.geometry.cameras import Camera
from styletrf.geometry.space import Space

Vector = Float[np.ndarray, " 3"]
INFINITY_PX = 0.25  # parallax between the outermost views below which a depth is infinite
Looking = Literal["ahead", "inward", "outward", "along"]


@dataclass(frozen=True, slots=True)
class Placement:
    """A scene in its space.

    Attributes:
        space: The map from the normalized world to the grid.
        normalized_from_world: The similarity that normalizes the world.
        resolution: Grid points along each axis at which a voxel matches the footprint of a pixel.
        focus: The point that the cameras look at, or away from.
        looking: The type of the capture: forward-facing (ahead), orbit (inward), outward, or
            walkthrough (along).
        evidence: The quantities behind these choices.
    """

    space: Space
    normalized_from_world: Float[np.ndarray, "4 4"]
    resolution: tuple[float, float, float]
    focus: tuple[float, float, float]
    looking: Looking
    evidence: dict[str, Any]


def transformed(
    matrix: Float[np.ndarray, "4 4"], points: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, "points 3"]:
    """Returns the points under an affine map."""
    result: Float[np.ndarray, "points 3"] = points @ matrix[:3, :3].T + matrix[:3, 3]
    return result


def unit_square_to(axis: Vector, vector: Vector) -> Vector:
    """Returns the direction of the part of `vector` that is perpendicular to the unit `axis`.

    If that part is almost zero, any perpendicular direction.
    """
    part = vector - (vector @ axis) * axis
    if np.linalg.norm(part) < 1e-3:
        part = np.cross(axis, np.eye(3)[np.abs(axis).argmax() - 1])
    unit: Vector = part / np.linalg.norm(part)
    return unit


def mean_view(cameras: Sequence[Camera]) -> Vector:
    """Returns the mean direction of the views, the first where they cancel."""
    mean = np.mean([camera.forward_world for camera in cameras], axis=0)
    length = np.linalg.norm(mean)
    unit: Vector = mean / length if length > 1e-3 else cameras[0].forward_world
    return unit


def facing_frame(cameras: Sequence[Camera]) -> Float[np.ndarray, "4 4"]:
    """Returns frame_from_world with z the mean view and y near the mean of the images' down."""
    z = mean_view(cameras)
    y = unit_square_to(z, np.mean([c.world_from_camera[:, 1] for c in cameras], axis=0))
    return frame_at_mean_center(cameras, y, z)


def frame_at_mean_center(
    cameras: Sequence[Camera], y: Vector, z: Vector
) -> Float[np.ndarray, "4 4"]:
    """Returns frame_from_world: the rigid frame with these axes at the mean of the centers."""
    rotation = np.stack([np.cross(y, z), y, z])
    frame = np.eye(4)
    frame[:3, :3] = rotation
    frame[:3, 3] = -rotation @ np.mean([camera.center_world for camera in cameras], axis=0)
    return frame
