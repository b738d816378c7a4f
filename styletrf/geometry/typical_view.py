"""The lens and the shape of the renders of a scene: those of most of its photographs."""

from collections.abc import Sequence

import numpy as np

from styletrf.geometry.cameras import Camera, resized

_ONE_SHAPE = 1.02  # ratio of aspects, up to which pictures are of one shape


def typical_view(cameras: Sequence[Camera]) -> Camera:
    """Returns the camera of a typical photograph, at the longest side of all photographs.

    The camera is landscape or portrait as most photographs are, and landscape in a tie. It has
    their median aspect and, of those with that aspect, the median focal length for its size.
    """
    landscape = [camera for camera in cameras if camera.width >= camera.height]
    portrait = [camera for camera in cameras if camera.width < camera.height]
    alike = landscape if len(landscape) >= len(portrait) else portrait
    aspect = _middle([camera.width / camera.height for camera in alike])
    of_shape = [c for c in alike if 1 / _ONE_SHAPE < c.width / c.height / aspect < _ONE_SHAPE]
    focal = _middle([camera.fx / camera.width for camera in of_shape])
    view = next(camera for camera in of_shape if camera.fx / camera.width == focal)
    scale = max(max(c.width, c.height) for c in cameras) / max(view.width, view.height)
    return resized(view, round(view.width * scale), round(view.height * scale))


def _middle(values: Sequence[float]) -> float:
    """Returns the median, or the lower of two in the middle: always one of the values."""
    return float(np.sort(values)[(len(values) - 1) // 2])
