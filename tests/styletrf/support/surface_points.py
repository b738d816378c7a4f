"""The surface points that a view of the courtyard shows."""

import numpy as np

from styletrf.geometry.cameras import Camera, pixel_centers, points_at_depth


def surface_points(camera: Camera, depth: np.ndarray) -> np.ndarray:
    """Returns the world points behind the pixel centers, without the sky."""
    is_surface = np.isfinite(depth.reshape(-1))
    pixels = pixel_centers(camera.width, camera.height)[is_surface]
    return points_at_depth(camera, pixels, depth.reshape(-1)[is_surface])
