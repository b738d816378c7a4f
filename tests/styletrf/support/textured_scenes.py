"""Photographs of a textured surface whose depths are known in closed form."""

from dataclasses import replace

import numpy as np
from captures import forward_cameras, seen

from styletrf.geometry.cameras import Camera, pixel_centers, points_at_depth
from styletrf.geometry.point_table import SparsePoints
from styletrf.scene.stereo.plane_sweep import GrayView

NORMAL, OFFSET = np.array([0.3, 0.1, -1.0]), -4.0  # n . x = offset: a slanted wall


def textured_cameras() -> list[Camera]:
    """Returns five cameras near each other, of 96 x 64 pixels."""
    lens = {"width": 96, "height": 64, "fx": 80.0, "fy": 80.0, "cx": 47.0, "cy": 33.0}
    return [replace(camera, **lens) for camera in forward_cameras(5)]


def wall_depth(camera: Camera) -> np.ndarray:
    """Returns the depth of the wall at every pixel, `height width`."""
    pixels = pixel_centers(camera.width, camera.height)
    toward = points_at_depth(camera, pixels, np.ones(len(pixels))) - camera.center_world
    depth = (OFFSET - camera.center_world @ NORMAL) / (toward @ NORMAL)
    return depth.reshape(camera.height, camera.width)


def wall_picture(camera: Camera, contrast: float = 0.4, seed: int = 0) -> np.ndarray:
    """Returns a photograph of the wall, RGB in [0, 1]: waves of many lengths and directions."""
    pixels = pixel_centers(camera.width, camera.height)
    at = points_at_depth(camera, pixels, wall_depth(camera).ravel())
    rng = np.random.default_rng(seed)
    waves, phases = rng.normal(0, 8, (3, 30)), rng.uniform(0, 2 * np.pi, 30)
    gray = 0.5 + contrast * np.sin(at @ waves + phases).mean(axis=1)
    gray = gray.reshape(camera.height, camera.width, 1)
    return np.repeat(gray, 3, axis=2).clip(0, 1)


def wall_view(camera: Camera, contrast: float = 0.4) -> GrayView:
    """Returns what a plane sweep compares."""
    gray = wall_picture(camera, contrast)[..., 0].astype(np.float32)
    return GrayView(camera, gray, np.ones(gray.shape, bool))


def wall_points(cameras: list[Camera]) -> SparsePoints:
    """Returns points on the wall, with the cameras that see them."""
    rng = np.random.default_rng(1)
    pixels = rng.uniform(0, (96, 64), (200, 2))
    depth = wall_depth(cameras[0])[pixels[:, 1].astype(int), pixels[:, 0].astype(int)]
    return seen(cameras, points_at_depth(cameras[0], pixels, depth))
