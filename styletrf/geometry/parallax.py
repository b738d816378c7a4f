"""Measures the parallax between photographs: the common points that no homography explains.

Two photographs from one spot, or of one plane, differ by a homography, whatever depth a mapping
made up for them. Where things stand before or behind each other, some points do not fit it.
"""

from collections.abc import Iterator, Sequence

import cv2
import numpy as np
from jaxtyping import Bool, Float

from styletrf.even_spread import evenly_spread
from styletrf.geometry.cameras import Camera
from styletrf.geometry.point_table import SparsePoints

LEAST_PARALLAX = 0.01
"""Least `parallax_fraction` of photographs with parallax; turns and flat walls are below 0.001."""
_LEAST_SHARED = 30  # points of a pair
_MOST_PAIRS = 200  # spread evenly over all
_ERROR = 0.004  # of the longer side, by which a point may be off
_LEAST_ERROR_PX = 2.0

Pixels = Float[np.ndarray, "points 2"]


def parallax_fraction(points: SparsePoints, cameras: Sequence[Camera]) -> float:
    """Returns the fraction of the common points of pairs that fits no homography between them.

    The fraction is 0 where there is no parallax, and where no two share thirty points.

    Args:
        points: The points with their tracks; the pixels are undistorted.
        cameras: The cameras, in the order in which `points` counts images.
    """
    shared = list(_shared(points, len(cameras)))
    longest = max(max(camera.width, camera.height) for camera in cameras)
    error_px = max(_ERROR * longest, _LEAST_ERROR_PX)
    some = evenly_spread(shared, _MOST_PAIRS)
    off = [_off_homography(a, b, error_px) for a, b in some]
    return float(np.concatenate(off).mean()) if off else 0.0


def _shared(points: SparsePoints, n_images: int) -> Iterator[tuple[Pixels, Pixels]]:
    """Yields where pairs of images show the points that they share."""
    observed = []
    for image in range(n_images):
        of_image = points.observed_image == image
        seen, first = np.unique(points.observed_point[of_image], return_index=True)
        observed.append((seen, points.observed_pixel[of_image][first]))
    for i, (seen_a, pixels_a) in enumerate(observed):
        for seen_b, pixels_b in observed[i + 1 :]:
            _, a, b = np.intersect1d(seen_a, seen_b, assume_unique=True, return_indices=True)
            if len(a) >= _LEAST_SHARED:
                yield pixels_a[a], pixels_b[b]


def _off_homography(a: Pixels, b: Pixels, error_px: float) -> Bool[np.ndarray, " points"]:
    """Returns which points are off the homography that most fit."""
    inliers = cv2.findHomography(a, b, cv2.RANSAC, error_px, maxIters=500)[1]
    return np.asarray(inliers[:, 0] == 0)
