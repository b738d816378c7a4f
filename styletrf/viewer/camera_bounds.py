"""Bounds the viewer's camera: it stays near cameras that saw the scene, and looks as they did.

Beyond them a field shows what no photograph ever checked.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from styletrf.geometry.cameras import Camera

_MOST_GUIDES = 400
_LEAST_RADIUS = 0.02  # of the extent of all cameras
_REACH_RAD = 0.5


@dataclass(frozen=True, slots=True)
class CameraBounds:
    """Balls and cones that the camera stays in.

    Attributes:
        guides: The centers and directions of cameras, in the normalized world.
        down: The world's down, as most cameras are held; a unit vector.
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
    mean = np.mean([camera.world_from_camera[:, 1] for camera in photographed], axis=0)
    if np.linalg.norm(mean) < 1e-3:
        mean = path[0].world_from_camera[:, 1]
    x, y, z = (mean / np.linalg.norm(mean)).tolist()
    return CameraBounds(guides, (x, y, z), _radius(photographed, every), _REACH_RAD)


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
