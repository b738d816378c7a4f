"""Views of the courtyard: color and exact depth for a camera."""

from typing import no_type_check

import numpy as np
from jaxtyping import Float, UInt8

from styletrf.geometry.cameras import Camera
from styletrf.synthetic.courtyard.rays import kernel, new_stack
from styletrf.synthetic.courtyard.shading import Surfaces, seen_color

# Five rays a pixel, each in a row and a column of its own; the first is through the center.
RAYS = np.array([[0.5, 0.5], [0.1, 0.3], [0.3, 0.9], [0.7, 0.1], [0.9, 0.7]])
BRIGHTEST = 3.0  # a ray's linear light is cut here, so that no glint outshines its pixel
_EXPOSURE = 0.8


def render_linear(
    scene: Surfaces, camera: Camera
) -> tuple[Float[np.ndarray, "height width 3"], Float[np.ndarray, "height width"]]:
    """Returns linear light, averaged over each pixel's area, and depth Z at the pixel centers.

    Depth is along the camera's axis in meters, and infinite in the sky.
    """
    intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    light = np.zeros((camera.height, camera.width, 3))
    depth = np.empty((camera.height, camera.width))
    _trace(scene, camera.world_from_camera, intrinsics, RAYS, light, depth)
    return light, depth


def developed(light: Float[np.ndarray, "height width 3"]) -> UInt8[np.ndarray, "height width 3"]:
    """Returns a photograph of linear light: highlights roll off, values sRGB-encoded."""
    x = _EXPOSURE * light
    shoulder = x * (1 + x / 6.25) / (1 + 0.55 * x)  # Reinhard et al. 2002, with a softer toe
    x = np.clip(shoulder, 0, 1)
    encoded = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(255 * encoded), dtype=np.uint8)


@no_type_check
@kernel
def _trace(scene, world_from_camera, intrinsics, offsets, light, depth):
    stack = new_stack()
    fx, fy, cx, cy = intrinsics
    R = world_from_camera[:, :3]
    ox, oy, oz = world_from_camera[:, 3]
    for row in range(light.shape[0]):
        for column in range(light.shape[1]):
            for i in range(len(offsets)):
                x = (column + offsets[i, 0] - cx) / fx
                y = (row + offsets[i, 1] - cy) / fy
                dx = R[0, 0] * x + R[0, 1] * y + R[0, 2]
                dy = R[1, 0] * x + R[1, 1] * y + R[1, 2]
                dz = R[2, 0] * x + R[2, 1] * y + R[2, 2]
                r, g, b, z = seen_color(scene, stack, ox, oy, oz, dx, dy, dz)
                light[row, column, 0] += min(r, BRIGHTEST) / len(offsets)
                light[row, column, 1] += min(g, BRIGHTEST) / len(offsets)
                light[row, column, 2] += min(b, BRIGHTEST) / len(offsets)
                if i == 0:
                    depth[row, column] = z
