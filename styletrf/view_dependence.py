"""Whether a scene looks different from different sides, as the tracks of its points show.

A point on a matte surface keeps its colour when one walks around it: what differs between two
photographs is the neighbourhood that a pixel mixes in. So the difference of a point's colours is
measured in units of the contrast about it,

    difference_ij = |c_i - c_j| / sqrt(floor^2 + contrast^2),

both of images blurred to a few pixels, after each photograph's exposure is made that of the
others. Points on matte surfaces stay below 1, highlights and mirrors go beyond.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from jaxtyping import Float

from styletrf.cameras import Camera
from styletrf.exposures import exposures
from styletrf.point_table import SparsePoints

LEAST_SHARE = 0.01  # of the points that differ, for a scene whose looks depend on the view
ENOUGH_POINTS = 200  # seen from sides so far apart, to tell
SIDES_DEG = 30.0  # between two views of a point: from nearer by, highlights hardly move
_LEAST_PAIRS = 3  # of views of a point
_MOST_PAIRS = 24
_FLOOR = 0.01
_LONG_SIDE = 504  # that photographs are looked at with
_BLUR, _NEIGHBOURHOOD = 1.5, 8.0  # pixels of it
_DARKEST = 0.03


@dataclass(frozen=True, slots=True)
class ViewDependence:
    """The share of the points seen from sides at least SIDES_DEG apart that look different there.

    `points` is how many were seen so.
    """

    share: float
    points: int

    @property
    def needed(self) -> bool:
        """Whether colours must depend on the view; where too little tells, they may."""
        return self.points < ENOUGH_POINTS or self.share >= LEAST_SHARE


def view_dependence(
    images: Iterable[Float[np.ndarray, "height width 3"]],
    points: SparsePoints,
    cameras: list[Camera],
) -> ViewDependence:
    """Returns what the tracks show; images (in [0, 1]) and cameras in the order of the table."""
    color, contrast = _observed(images, points)
    log_light = np.log(np.maximum(color.mean(axis=1), _DARKEST))
    gain = np.exp(exposures(points, log_light, len(cameras)))
    color = color / gain[points.observed_image][:, None]
    centers = np.stack([camera.center_world for camera in cameras])
    to_camera = centers[points.observed_image] - points.xyz_world[points.observed_point]
    to_camera /= np.maximum(np.linalg.norm(to_camera, axis=1, keepdims=True), 1e-12)
    first, second = _pairs(points)
    apart = (to_camera[first] * to_camera[second]).sum(axis=1) <= np.cos(np.radians(SIDES_DEG))
    first, second = first[apart], second[apart]
    noise = _FLOOR**2 + ((contrast[first] + contrast[second]) / 2) ** 2
    squared = ((color[first] - color[second]) ** 2).mean(axis=1) / noise
    n = np.bincount(points.observed_point[first])
    total = np.bincount(points.observed_point[first], weights=squared)
    told = n >= _LEAST_PAIRS
    differ = total[told] > n[told]
    return ViewDependence(float(differ.mean()) if len(differ) else 0.0, len(differ))


def _observed(
    images: Iterable[Float[np.ndarray, "height width 3"]], points: SparsePoints
) -> tuple[Float[np.ndarray, "observations 3"], Float[np.ndarray, " observations"]]:
    """Returns the colour at each observation, and the contrast about it."""
    n = len(points.observed_point)
    color, contrast = np.zeros((n, 3)), np.zeros(n)
    for k, image in enumerate(images):
        of_image = points.observed_image == k
        if not of_image.any():
            continue
        scale = _LONG_SIDE / max(image.shape[:2])
        how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        resized = cv2.resize(image, None, fx=scale, fy=scale, interpolation=how)
        blurred = cv2.GaussianBlur(resized, (0, 0), _BLUR)
        mean = cv2.GaussianBlur(blurred, (0, 0), _NEIGHBOURHOOD)
        variance = cv2.GaussianBlur(blurred**2, (0, 0), _NEIGHBOURHOOD) - mean**2
        deviation = np.sqrt(np.maximum(variance, 0).mean(axis=2))
        pixel = (scale * points.observed_pixel[of_image] - 0.5).astype(np.float32)
        color[of_image] = _at(blurred, pixel)
        contrast[of_image] = _at(deviation, pixel)
    return color, contrast


def _at(image: np.ndarray, pixel: Float[np.ndarray, "observations 2"]) -> np.ndarray:
    """Returns the image between its pixels; a column of values at a time, as OpenCV wants it."""
    return np.concatenate(
        [
            cv2.remap(
                image, part[:, :1], part[:, 1:], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
            )[:, 0]
            for part in np.array_split(pixel, len(pixel) // 16384 + 1)
        ]
    )


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
