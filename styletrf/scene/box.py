"""The upright box around a scene that is seen from several sides."""

import numpy as np
from jaxtyping import Float

from styletrf.scene.placement import Placement
from styletrf.scene.upright_capture import Extent, UprightCapture, placed

_PERCENT = 98.0  # of the points along each axis: the others are astray, or far behind the scene


def place_in_box(scene: UprightCapture, oversampling: float) -> Placement:
    """Returns a box around nearly all points."""
    return placed(scene, whole_box(scene), "box", np.eye(4)[None], 1.0, oversampling, scene.pixel)


def whole_box(scene: UprightCapture) -> Extent:
    """Returns the box around nearly all points."""
    return box_around(scene.points, _PERCENT)


def box_around(points: Float[np.ndarray, "points 3"], percent: float) -> Extent:
    """Returns the box around the middle `percent` of the points along each axis, with a margin."""
    beyond = (100 - percent) / 2
    lower, upper = np.percentile(points, [beyond, 100 - beyond], axis=0)
    half = 1.15 * (upper - lower) / 2
    return Extent((lower + upper) / 2, np.maximum(half, 0.02 * half.max()))
