"""Views cut from an equirectangular panorama, as pinhole cameras at its place would see them.

The axes of a panorama are x right, y down, z ahead. A direction at the longitude l (to the right)
and the angle b below the horizon is seen at the fractions (l / 2 pi + 1/2, b / pi + 1/2) of its
width and height. Four views stand around the horizon, 100 degrees wide and of the shape 4:3, and a
square one looks up. With t = tan(50 degrees), at the angle a aside from its middle, a side view
ends at an elevation of tangent 3/4 t cos(a), and the upper view begins at one of cos(a) / t, which
is lower: t^2 > 4/3. So nothing is left out but the ground below, where the tripod or the
photographer is.
"""

import math
from collections.abc import Iterator

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from styletrf.geometry.cameras import Camera, directions_of_all_pixels

Image = UInt8[np.ndarray, "_ _ 3"]  # each of its own size

FOV_DEG = 100.0
MOST_PX = 1600  # as wide as photographs are worked on
_SHAPE = 3, 4  # height to width of the views around the horizon
_PADDING_PX = 4  # more than cubic interpolation reads
_X, _Y, _Z = np.eye(3)

_AXES = {
    "front": (_X, _Y, _Z),
    "right": (-_Z, _Y, _X),
    "back": (-_X, _Y, -_Z),
    "left": (_Z, _Y, -_X),
    "up": (_X, _Z, -_Y),
}
DIRECTIONS = tuple(_AXES)


def view_name(panorama: str, direction: str) -> str:
    """Returns the name of a view that is cut from the panorama of that name."""
    return f"{panorama}_{direction}"


def panorama_from_view(direction: str) -> Float[np.ndarray, "3 3"]:
    """Returns the rotation from the axes of a view to those of its panorama."""
    return np.stack(_AXES[direction], axis=1)


def view_focal_px(width: int) -> float:
    """Returns the focal length of a view that is so many pixels wide."""
    return width / 2 / math.tan(math.radians(FOV_DEG / 2))


def view_camera(direction: str, panorama_width: int) -> Camera:
    """Returns the camera of a view, in the axes of its panorama.

    In the middle of the view a pixel is as wide as one of the panorama on its horizon, or wider
    where the view would be wider than 1600 pixels.
    """
    native_px = panorama_width / (2 * math.pi) * 2 * math.tan(math.radians(FOV_DEG / 2))
    rows, columns = _SHAPE
    width = min(MOST_PX, columns * math.ceil(native_px / columns))
    height = width if direction == "up" else width * rows // columns
    focal = view_focal_px(width)
    pose = np.column_stack([panorama_from_view(direction), np.zeros(3)])
    return Camera(direction, width, height, focal, focal, width / 2, height / 2, pose)


def cut_views(panorama: Image) -> Iterator[tuple[str, Image]]:
    """Yields the views of a panorama by their directions."""
    for direction in DIRECTIONS:
        camera = view_camera(direction, panorama.shape[1])
        yield direction, seen_in_panorama(panorama, camera)


def seen_in_panorama(panorama: Image, camera: Camera) -> Image:
    """Returns a camera's view of a panorama (bicubic), whose axes are the camera's world.

    Where the middle of the image is coarser than the panorama, this is first reduced by area.
    """
    height, width = panorama.shape[:2]
    scale = 2 * math.pi * camera.fx / width
    if scale < 1:
        size = max(2, round(width * scale)), max(1, round(height * scale))
        panorama = np.asarray(cv2.resize(panorama, size, interpolation=cv2.INTER_AREA))
    rays = directions_of_all_pixels(camera) @ camera.world_from_camera[:, :3].T
    sources = panorama_pixels(rays, panorama.shape[1], panorama.shape[0]) + _PADDING_PX - 0.5
    x, y = sources.astype(np.float32).T.reshape(2, camera.height, camera.width)
    seen = cv2.remap(_padded(panorama), x, y, cv2.INTER_CUBIC)
    return np.asarray(seen, dtype=np.uint8)


def panorama_pixels(
    directions: Float[np.ndarray, "rays 3"], width: int, height: int
) -> Float[np.ndarray, "rays 2"]:
    """Returns where a panorama shows directions of any length, in its axes, as pixels (x, y)."""
    x, y, z = directions.T
    longitude, below = np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))
    fractions = np.stack([longitude / (2 * np.pi), below / np.pi], axis=-1) + 0.5
    return np.asarray(fractions * (width, height))


def _padded(panorama: Image) -> Image:
    """Returns the panorama continued beyond its edges: by the other side, and over the poles."""
    half = panorama.shape[1] // 2
    over_top = np.roll(panorama[:_PADDING_PX][::-1], half, axis=1)
    over_bottom = np.roll(panorama[-_PADDING_PX:][::-1], half, axis=1)
    tall = np.concatenate([over_top, panorama, over_bottom])
    return np.asarray(np.pad(tall, ((0, 0), (_PADDING_PX, _PADDING_PX), (0, 0)), mode="wrap"))
