"""Focal lengths in units of the longer side of an image, and angles of view along it."""

import math
from dataclasses import replace

from styletrf.geometry.cameras import Camera, resized


def focal_of(camera: Camera) -> float:
    """Returns the focal length of a camera in units of the longer side."""
    focal_px = camera.fx if camera.width >= camera.height else camera.fy
    return focal_px / max(camera.width, camera.height)


def focal_from(fov_deg: float) -> float:
    """Returns the focal length, in units of the longer side, that has an angle of view along it."""
    return 0.5 / math.tan(math.radians(fov_deg) / 2)


def with_focal(camera: Camera, focal: float) -> Camera:
    """Returns the camera with another focal length and its optical axis through the middle."""
    scale = focal / focal_of(camera)
    return replace(
        camera,
        fx=camera.fx * scale,
        fy=camera.fy * scale,
        cx=camera.width / 2,
        cy=camera.height / 2,
    )


def at_size(camera: Camera, long_side_px: int, fov_deg: float) -> Camera:
    """Returns the camera with images of a length and an angle of view; 0 leaves either as it is."""
    if long_side_px:
        scale = long_side_px / max(camera.width, camera.height)
        width, height = (max(1, round(side * scale)) for side in (camera.width, camera.height))
        camera = resized(camera, width, height)
    return with_focal(camera, focal_from(fov_deg)) if fov_deg else camera
