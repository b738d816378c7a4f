"""Exact optical flow between two views whose depth is known."""

import numpy as np
from jaxtyping import Bool, Float

from styletrf.geometry.cameras import Camera, directions_camera, pixel_centers

Depth = Float[np.ndarray, "height width"]


def exact_flow(
    camera_a: Camera, depth_a: Depth, camera_b: Camera, depth_b: Depth, tolerance: float = 0.01
) -> tuple[Float[np.ndarray, "height width 2"], Bool[np.ndarray, "height width"]]:
    """Returns the flow (x, y) in pixels from a to b at pixel centers of a, and where b sees it.

    A point at pixel x and depth Z, infinite in the sky, goes to
    `K_b (R_b^T R_a K_a^-1 x + R_b^T (c_a - c_b) / Z)`. It is visible where it falls between pixel
    centers of b, in front, with 1/Z equal to that of `depth_b` within the fraction `tolerance`.
    1/Z is affine in the image of a plane, so that its interpolation is exact there.
    """
    pixels = pixel_centers(camera_a.width, camera_a.height)
    rays = directions_camera(camera_a, pixels)
    inverse_depth = 1 / depth_a.reshape(-1, 1).astype(np.float64)
    b_from_world = camera_b.world_from_camera[:, :3].T
    rays_b = rays @ (b_from_world @ camera_a.world_from_camera[:, :3]).T
    points_b = rays_b + inverse_depth * (
        b_from_world @ (camera_a.center_world - camera_b.center_world)
    )
    scale = points_b[:, 2:]
    in_front = scale[:, 0] > 0
    safe = np.where(scale > 0, scale, 1.0)
    pixels_b = points_b[:, :2] / safe * [camera_b.fx, camera_b.fy] + [camera_b.cx, camera_b.cy]
    shape = camera_a.height, camera_a.width
    expected = (inverse_depth / safe).reshape(shape)
    found, inside = _inverse_depth_at(depth_b, pixels_b.reshape(*shape, 2))
    rounding = 1e-9 * (1 / depth_b).max()  # the sky, where 1/Z is zero, must agree as well
    agrees = np.abs(found - expected) <= tolerance * expected + rounding
    flow = np.where(in_front[:, None], pixels_b - pixels, 0.0).reshape(*shape, 2)
    return flow, in_front.reshape(shape) & inside & agrees


def _inverse_depth_at(
    depth: Depth, pixels: Float[np.ndarray, "h w 2"]
) -> tuple[Float[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
    """Returns 1/Z interpolated at pixels, and which of them lie between pixel centers."""
    height, width = depth.shape
    x, y = pixels[..., 0] - 0.5, pixels[..., 1] - 0.5
    slack = 1e-6
    inside = (x >= -slack) & (y >= -slack) & (x <= width - 1 + slack) & (y <= height - 1 + slack)
    x0 = np.clip(np.floor(x), 0, max(width - 2, 0)).astype(np.intp)
    y0 = np.clip(np.floor(y), 0, max(height - 2, 0)).astype(np.intp)
    x1, y1 = np.minimum(x0 + 1, width - 1), np.minimum(y0 + 1, height - 1)
    fx, fy = np.clip(x - x0, 0, 1), np.clip(y - y0, 0, 1)
    inverse = 1 / depth.astype(np.float64)
    upper = (1 - fx) * inverse[y0, x0] + fx * inverse[y0, x1]
    lower = (1 - fx) * inverse[y1, x0] + fx * inverse[y1, x1]
    return (1 - fy) * upper + fy * lower, inside
