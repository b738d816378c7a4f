"""A pinhole camera, the points behind its pixels, and projection.

Letters: `fx fy cx cy` in pixels; conventions in `docs/conventions.md`.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

FAR = 1e6  # depth of what is infinitely far, in units of the normalized scene


@dataclass(frozen=True, slots=True)
class Camera:
    """One undistorted photograph's camera, or one of a trajectory.

    `world_from_camera` is 3x4 (float64): the columns of the rotation are the camera's x, y, z axes
    in the world, the last column its center.
    """

    name: str
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    world_from_camera: Float[np.ndarray, "3 4"]

    @property
    def center_world(self) -> Float[np.ndarray, " 3"]:
        """The center of projection."""
        return self.world_from_camera[:, 3]

    @property
    def forward_world(self) -> Float[np.ndarray, " 3"]:
        """The unit vector along the optical axis."""
        return self.world_from_camera[:, 2]


def camera_numbers(camera: Camera) -> tuple[str, Float[np.ndarray, " 16"]]:
    """Returns "camera NAME" and all its numbers, pose and lens, to see whether they are finite."""
    lens = [camera.fx, camera.fy, camera.cx, camera.cy]
    return f"camera {camera.name}", np.concatenate([camera.world_from_camera.reshape(-1), lens])


def resized(camera: Camera, width: int, height: int) -> Camera:
    """Returns the camera of the same photograph resampled to `width` x `height`."""
    sx, sy = width / camera.width, height / camera.height
    return replace(
        camera,
        width=width,
        height=height,
        fx=camera.fx * sx,
        fy=camera.fy * sy,
        cx=camera.cx * sx,
        cy=camera.cy * sy,
    )


def fitted_to(camera: Camera, long_side: int) -> Camera:
    """Returns the camera resized so that its longer side is at most `long_side` pixels."""
    scale = min(1.0, long_side / max(camera.width, camera.height))
    return resized(
        camera, max(1, round(camera.width * scale)), max(1, round(camera.height * scale))
    )


def moved(camera: Camera, new_from_world: Float[np.ndarray, "4 4"]) -> Camera:
    """Returns the camera in a new world, reached by the similarity `new_from_world`.

    The scale of the similarity moves the center and leaves the axes orthonormal.
    """
    linear, offset = new_from_world[:3, :3], new_from_world[:3, 3]
    scale = np.cbrt(np.linalg.det(linear))
    rotation = linear / scale @ camera.world_from_camera[:, :3]
    center = linear @ camera.center_world + offset
    return replace(camera, world_from_camera=np.column_stack([rotation, center]))


def pixel_centers(width: int, height: int) -> Float[np.ndarray, "pixels 2"]:
    """Returns the centers (x, y) of all pixels, row by row."""
    y, x = np.mgrid[0:height, 0:width]
    return np.stack([x, y], axis=-1).reshape(-1, 2) + 0.5


def directions_camera(
    camera: Camera, pixels: Float[np.ndarray, "pixels 2"]
) -> Float[np.ndarray, "pixels 3"]:
    """Returns the directions of pixels in the camera's frame, with z = 1."""
    on_plane = (pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    return np.column_stack([on_plane, np.ones(len(pixels))])


def directions_of_all_pixels(camera: Camera) -> Float[np.ndarray, "pixels 3"]:
    """Returns the directions of all pixels in the camera's frame, row by row, with z = 1."""
    directions = np.ones((camera.height, camera.width, 3))
    directions[..., 0] = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    directions[..., 1] = ((np.arange(camera.height) + 0.5 - camera.cy) / camera.fy)[:, None]
    return directions.reshape(-1, 3)


def finite_depth(depth: np.ndarray) -> np.ndarray:
    """Returns depths with `FAR` in place of infinity, in double precision."""
    return np.where(np.isfinite(depth), depth, FAR).astype(np.float64)


def points_at_depth(
    camera: Camera, pixels: Float[np.ndarray, "pixels 2"], depth: Float[np.ndarray, " pixels"]
) -> Float[np.ndarray, "pixels 3"]:
    """Returns the world points at `depth` (along the camera's z axis) behind `pixels`."""
    directions_world = directions_camera(camera, pixels) @ camera.world_from_camera[:, :3].T
    points_world: np.ndarray = camera.center_world + depth[:, None] * directions_world
    return points_world


def project(
    camera: Camera, points_world: Float[np.ndarray, "points 3"]
) -> tuple[Float[np.ndarray, "points 2"], Float[np.ndarray, " points"]]:
    """Returns the pixels of world points and their depth Z (negative behind the camera)."""
    rotation, center = camera.world_from_camera[:, :3], camera.center_world
    points_camera = (points_world - center) @ rotation
    depth = points_camera[:, 2]
    safe = np.where(depth == 0, np.finfo(depth.dtype).tiny, depth)
    x = camera.fx * points_camera[:, 0] / safe + camera.cx
    y = camera.fy * points_camera[:, 1] / safe + camera.cy
    return np.stack([x, y], axis=-1), depth


def in_view(
    camera: Camera, points_world: Float[np.ndarray, "points 3"]
) -> tuple[
    Float[np.ndarray, "points 2"], Float[np.ndarray, " points"], Bool[np.ndarray, " points"]
]:
    """Returns the result of `project`, and which points lie ahead and within the image."""
    pixels, depth = project(camera, points_world)
    inside = (depth > 0) & (pixels >= 0).all(axis=1)
    return pixels, depth, inside & (pixels < (camera.width, camera.height)).all(axis=1)


def depth_behind(
    camera: Camera,
    depth: Float[np.ndarray, "height width"],
    points_world: Float[np.ndarray, "points 3"],
) -> tuple[
    Float[np.ndarray, "points 2"], Float[np.ndarray, " points"], Float[np.ndarray, " points"],
    Bool[np.ndarray, " points"],
]:  # fmt: skip
    """Returns the results of `in_view`, and before the last the `depth` at the points' pixels.

    Where a point is out of view, the depth found means nothing.
    """
    pixels, depth_of_points, inside = in_view(camera, points_world)
    column, row = np.floor(np.where(inside[:, None], pixels, 0)).astype(int).T
    return pixels, depth_of_points, depth[row, column], inside
