"""Chooses the photographs that a photograph is compared with.

Neighbors share points, seen from directions far enough apart to give depths and near enough to look
alike. With a the angle between the rays of two photographs to a point, a neighbor's score is

    sum over shared points of min(1, (a / NARROW_DEG)^2, (WIDE_DEG / a)^2),

a smooth form of the scores of MVSNet (Yao et al. 2018, section 4.1).
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from styletrf.geometry.cameras import Camera
from styletrf.geometry.point_table import SparsePoints

NARROW_DEG, WIDE_DEG = 6.0, 25.0
MOST = 4
_FEWEST_POINTS = 5


def neighbors(cameras: Sequence[Camera], points: SparsePoints) -> list[list[int]]:
    """Returns up to four other photographs for each, the best first; none where none share points.

    Args:
        cameras: The cameras in the world of the points, in the order in which these count images.
        points: The points with their tracks.
    """
    centers = np.stack([camera.center_world for camera in cameras])
    return [_neighbors_of(k, centers, points) for k in range(len(cameras))]


def _neighbors_of(
    k: int, centers: Float[np.ndarray, "cameras 3"], points: SparsePoints
) -> list[int]:
    is_seen = np.zeros(len(points.xyz_world), bool)
    is_seen[points.observed_point[points.observed_image == k]] = True
    is_shared = is_seen[points.observed_point] & (points.observed_image != k)
    others, shared = points.observed_image[is_shared], points.observed_point[is_shared]
    at = points.xyz_world[shared]
    angles_deg = _angles_deg(at - centers[k], at - centers[others])
    worth = np.minimum((angles_deg / NARROW_DEG) ** 2, (WIDE_DEG / angles_deg.clip(1e-3)) ** 2)
    scores = np.bincount(others, worth.clip(max=1), minlength=len(centers))
    scores[np.bincount(others, minlength=len(centers)) < _FEWEST_POINTS] = 0
    best = np.argsort(-scores, kind="stable")[:MOST]
    return [int(j) for j in best if scores[j] > 0]


def _angles_deg(
    a: Float[np.ndarray, "points 3"], b: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, " points"]:
    cosines = (a * b).sum(axis=1) / (np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1))
    angles: Float[np.ndarray, " points"] = np.degrees(np.arccos(cosines.clip(-1, 1)))
    return angles
