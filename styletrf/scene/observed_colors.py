"""The colors that photographs show of sparse points, and the contrast around them."""

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

from styletrf.geometry.image_sampling import sample_at
from styletrf.geometry.point_table import SparsePoints

_LONG_SIDE = 504  # that photographs are looked at with
_BLUR, _NEIGHBORHOOD = 1.5, 8.0  # pixels of it
_DARKEST, _BRIGHTEST = 0.03, 0.95  # beyond, rounding and saturation hide the light


@dataclass(frozen=True, slots=True)
class ObservedColors:
    """At each observation of a point, the color in [0, 1] and the standard deviation about it."""

    color: Float[np.ndarray, "observations 3"]
    contrast: Float[np.ndarray, " observations"]

    @property
    def log_color(self) -> Float[np.ndarray, "observations 3"]:
        """The logarithms; NaN where they say little about the light.

        That is where a channel is too dark or saturated, and in the half of the observations with
        the greater contrast about them: the distance decides how much of the contrast a pixel mixes
        in.
        """
        is_known = (self.color > _DARKEST) & (self.color < _BRIGHTEST)
        relative = self.contrast / np.maximum(self.color.mean(axis=1), _DARKEST)
        is_even = relative <= (np.median(relative) if len(relative) else 0.0)
        return np.log(np.where(is_known & is_even[:, None], self.color, np.nan))


def observed_colors(
    images: Iterable[Float[np.ndarray, "height width 3"]], points: SparsePoints
) -> ObservedColors:
    """Returns the colors of images at the points, blurred to a few pixels.

    Args:
        images: The images, RGB in [0, 1], in the order in which `points` counts them.
        points: The points with their tracks.
    """
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
        mean = cv2.GaussianBlur(blurred, (0, 0), _NEIGHBORHOOD)
        variance = cv2.GaussianBlur(blurred**2, (0, 0), _NEIGHBORHOOD) - mean**2
        deviation = np.sqrt(np.maximum(variance, 0).mean(axis=2))
        pixel = scale * points.observed_pixel[of_image] - 0.5
        color[of_image] = sample_at(blurred, pixel)
        contrast[of_image] = sample_at(deviation, pixel)
    return ObservedColors(color, contrast)
