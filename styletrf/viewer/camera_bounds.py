"""Bounds the viewer's camera: it stays near cameras that saw the scene, and looks as they did.

Beyond them a field shows surfaces that no photograph constrained.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from styletrf.geometry.cameras import Camera

_MOST_GUIDES = 400
_LEAST_RADIUS = 0.02  # of the extent of all cameras
_REACH_RAD = 0.5
_ALONG = 0.98  # cosine of the angle to the vertical, above which a view looks along it


@dataclass(frozen=True, slots=True)
class CameraBounds:
    """Balls and cones that the camera stays in.

    Attributes:
        guides: The centers and directions of cameras, in the normalized world.
        down: The vertical that the camera turns about, as most cameras are held; a unit vector.
        radius: How far from a guide the camera may be.
        reach_rad: By what angle its direction may differ from that guide's.
    """

    guides: Sequence[tuple[list[float], list[float]]]
    down: tuple[float, float, float]
    radius: float
    reach_rad: float


def camera_bounds(photographed: Sequence[Camera], path: Sequence[Camera]) -> CameraBounds:
    """Returns the bounds that photographs, and a fly-through between them, support.

    The radius is how far photographs are usually apart, so that their balls overlap.
    """
    every = [*path, *photographed]
    some = every[:: -(-len(every) // _MOST_GUIDES)]
    guides = [(c.center_world.tolist(), c.forward_world.tolist()) for c in some]
    x, y, z = _down(photographed, path).tolist()
    return CameraBounds(guides, (x, y, z), _radius(photographed, every), _REACH_RAD)


def _down(photographed: Sequence[Camera], path: Sequence[Camera]) -> Float[np.ndarray, " 3"]:
    """Returns the mean down of the photographs.

    It is the path's own where there is none, or where most photographs look along it: turning
    about it would only roll the picture.
    """
    mean = np.mean([camera.world_from_camera[:, 1] for camera in photographed], axis=0)
    length = np.linalg.norm(mean)
    along = np.abs([camera.forward_world @ mean for camera in photographed])
    if length < 1e-3 or np.median(along) > _ALONG * length:
        return path[0].world_from_camera[:, 1]
    down: Float[np.ndarray, " 3"] = mean / length
    return down


def _radius(photographed: Sequence[Camera], every: Sequence[Camera]) -> float:
    centers = np.stack([camera.center_world for camera in photographed])
    extent = float(np.linalg.norm(np.ptp([c.center_world for c in every], axis=0)))
    return max(_spacing(centers), _LEAST_RADIUS * extent, 1e-6)


def _spacing(centers: Float[np.ndarray, "cameras 3"]) -> float:
    """Returns the median distance to the nearest other camera."""
    apart = np.linalg.norm(centers[:, None] - centers[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    nearest = apart.min(axis=1)
    return float(np.median(nearest)) if len(centers) > 1 else 0.0
