"""Decides by the tracks of points whether the colors of a scene depend on the view.

A point on a matte surface keeps its color when one walks around it: only the neighborhood that a
pixel mixes in differs between two photographs. So the difference of a point's colors is measured in
units of the contrast about it,

    difference_ij = |c_i - c_j| / sqrt(floor^2 + contrast^2),

both of images blurred to a few pixels, after each photograph's exposure is made that of the
others. Points on matte surfaces stay below 1, highlights and mirrors go beyond.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from styletrf.geometry.cameras import Camera
from styletrf.geometry.point_table import SparsePoints
from styletrf.scene.exposures import estimate_exposures
from styletrf.scene.observed_colors import ObservedColors

LEAST_FRACTION = 0.01  # of the points that differ, for a scene whose looks depend on the view
ENOUGH_POINTS = 200  # seen from sides so far apart, for a decision
SIDES_DEG = 30.0  # between two views of a point: from nearer by, highlights hardly move
_LEAST_PAIRS = 3  # of views of a point
_MOST_PAIRS = 24
_FLOOR = 0.01


@dataclass(frozen=True, slots=True)
class ViewDependence:
    """How many points look different from different sides.

    `share` is their fraction of the points that were seen from sides at least SIDES_DEG apart, and
    `points` the number of these.
    """

    share: float
    points: int

    @property
    def needed(self) -> bool:
        """Whether colors must depend on the view; they may if there is too little evidence."""
        return self.points < ENOUGH_POINTS or self.share >= LEAST_FRACTION


def view_dependence(
    observed: ObservedColors, points: SparsePoints, cameras: list[Camera]
) -> ViewDependence:
    """Returns the view dependence of the tracks.

    Args:
        observed: The colors at the observations of the points.
        points: The points with their tracks.
        cameras: The cameras, in the order in which `points` counts images.
    """
    exposures = estimate_exposures(points, observed.log_color, len(cameras))
    color = exposures.evened(observed.color, points.observed_image)
    centers = np.stack([camera.center_world for camera in cameras])
    to_camera = centers[points.observed_image] - points.xyz_world[points.observed_point]
    to_camera /= np.maximum(np.linalg.norm(to_camera, axis=1, keepdims=True), 1e-12)
    first, second = _pairs(points)
    apart = (to_camera[first] * to_camera[second]).sum(axis=1) <= np.cos(np.radians(SIDES_DEG))
    first, second = first[apart], second[apart]
    noise = _FLOOR**2 + ((observed.contrast[first] + observed.contrast[second]) / 2) ** 2
    squared = ((color[first] - color[second]) ** 2).mean(axis=1) / noise
    n = np.bincount(points.observed_point[first])
    total = np.bincount(points.observed_point[first], weights=squared)
    enough = n >= _LEAST_PAIRS
    differ = total[enough] > n[enough]
    return ViewDependence(float(differ.mean()) if len(differ) else 0.0, len(differ))


def _pairs(points: SparsePoints) -> tuple[np.ndarray, np.ndarray]:
    """Returns pairs of observations of the same point, the same every time."""
    rng = np.random.default_rng(0)
    order = np.argsort(points.observed_point, kind="stable")
    starts = np.concatenate([[0], np.cumsum(points.track_length)])
    first, second = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for start, end in pairwise(starts):
        a, b = np.triu_indices(end - start, 1)
        if len(a) > _MOST_PAIRS:
            chosen = rng.choice(len(a), _MOST_PAIRS, replace=False)
            a, b = a[chosen], b[chosen]
        first.append(order[start + a])
        second.append(order[start + b])
    return np.concatenate(first), np.concatenate(second)
