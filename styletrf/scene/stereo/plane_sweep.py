"""The depths of one photograph by a plane sweep (Collins 1996).

The photograph is compared with its neighbors as they would look if all it shows lay in one plane
before it, for planes spread evenly in inverse depth. Photographs are compared by the normalized
cross-correlation of a window,

    cov(a, b) / sqrt((var(a) + NOISE) (var(b) + NOISE)),

which exposure does not change and which is near 0 where a window has no texture. A plane's score at
a pixel is the mean of its best two neighbors, so that one may be hidden there (Kang et al. 2001).
The depth is that of the best plane, and between planes the vertex of a parabola.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32

from styletrf.geometry.cameras import Camera

PLANES = 96
NOISE = 1e-4  # a variance of gray in [0, 1]
_RADIUS = 3  # of a window, in pixels
_BEST = 2

Gray = Float32[np.ndarray, "height width"]


@dataclass(frozen=True, slots=True)
class GrayView:
    """A photograph to compare.

    Attributes:
        camera: The camera of the photograph.
        gray: Its gray levels in [0, 1].
        counts: Which of its pixels count.
    """

    camera: Camera
    gray: Gray
    counts: Bool[np.ndarray, "height width"]


@dataclass(frozen=True, slots=True)
class SweptDepth:
    """The best plane of each pixel.

    Attributes:
        depth: The depth along the camera's axis.
        score: The score of the best plane, from -1 to 1; -1 where it is the first or the last.
    """

    depth: Gray
    score: Gray


def swept_depth(
    view: GrayView, others: Sequence[GrayView], nearest: float, farthest: float
) -> SweptDepth:
    """Returns the depths that explain a photograph best.

    Args:
        view: The photograph.
        others: Its neighbors; at least one.
        nearest: The depth of the nearest plane, above 0.
        farthest: The depth of the farthest plane.
    """
    inverse = np.linspace(1 / farthest, 1 / nearest, PLANES)
    own = _moments(view.gray)
    scores = np.stack([_plane_score(view, own, others, float(value)) for value in inverse])
    best = scores.argmax(axis=0)
    middle = best.clip(1, PLANES - 2)
    left, top, right = (_at(scores, middle + k) for k in (-1, 0, 1))
    curvature = left - 2 * top + right
    vertex = 0.5 * (left - right) / np.where(curvature < -1e-6, curvature, -1e-6)
    at = middle + vertex.clip(-0.5, 0.5)
    depth = 1 / (inverse[0] + (inverse[1] - inverse[0]) * at)
    return SweptDepth(depth.astype(np.float32), np.where(best == middle, top, np.float32(-1)))


def _plane_score(
    view: GrayView, own: tuple[Gray, Gray], others: Sequence[GrayView], inverse: float
) -> Gray:
    """Returns the score of the plane at a depth; -1 where no neighbor sees it."""
    each = np.stack(list(_correlations(view, own, others, inverse)))
    best: Gray = np.sort(each, axis=0)[-_BEST:].mean(axis=0)
    return best


def _correlations(
    view: GrayView, own: tuple[Gray, Gray], others: Sequence[GrayView], inverse: float
) -> Iterator[Gray]:
    mean, variance = own
    for other in others:
        warped, is_seen = _through_plane(view.camera, other, inverse)
        other_mean, other_variance = _moments(warped)
        covariance = _window_mean(warped * view.gray) - other_mean * mean
        correlation = covariance / np.sqrt((variance + NOISE) * (other_variance + NOISE))
        yield np.where(is_seen, correlation, np.float32(-1))


def _moments(gray: Gray) -> tuple[Gray, Gray]:
    mean = _window_mean(gray)
    return mean, np.maximum(_window_mean(gray * gray) - mean * mean, 0)


def _window_mean(values: Gray) -> Gray:
    side = 2 * _RADIUS + 1
    result: Gray = cv2.blur(values, (side, side))
    return result


def _through_plane(
    camera: Camera, other: GrayView, inverse: float
) -> tuple[Gray, Bool[np.ndarray, "height width"]]:
    """Returns another photograph as a camera sees it on a plane, and where it shows that plane.

    A point of the plane at depth z behind pixel p is z K^-1 p, so that pixel q of the other camera
    is the homography K' (R + t n^T / z) K^-1 p, n being the axis of the first.
    """
    rotation = other.camera.world_from_camera[:, :3].T @ camera.world_from_camera[:, :3]
    offset = other.camera.world_from_camera[:, :3].T @ (
        camera.center_world - other.camera.center_world
    )
    through_plane = rotation + inverse * np.outer(offset, [0, 0, 1])
    homography = _lens(other.camera) @ through_plane @ np.linalg.inv(_lens(camera))
    size, flags = (camera.width, camera.height), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    warped = cv2.warpPerspective(other.gray, homography, size, flags=flags)
    counts = cv2.warpPerspective(other.counts.astype(np.float32), homography, size, flags=flags)
    x, y = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    is_ahead = homography[2, 0] * x + homography[2, 1] * y + homography[2, 2] > 0
    return np.where(is_ahead, warped, np.float32(0)), is_ahead & (counts > 0.99)


def _lens(camera: Camera) -> Float[np.ndarray, "3 3"]:
    """Returns the matrix to pixels whose centers are whole numbers, as OpenCV counts them."""
    return np.array([[camera.fx, 0, camera.cx - 0.5], [0, camera.fy, camera.cy - 0.5], [0, 0, 1.0]])


def _at(scores: Float32[np.ndarray, "planes height width"], plane: np.ndarray) -> Gray:
    result: Gray = np.take_along_axis(scores, plane[None], axis=0)[0]
    return result
