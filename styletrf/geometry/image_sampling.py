"""Samples images between their pixels."""

import cv2
import numpy as np
from jaxtyping import Float, Real

_WIDEST = 1 << 12  # pixels; OpenCV's images have sides of at most 32,767


def sample_at(
    image: Real[np.ndarray, "height width *channels"],
    points_px: Float[np.ndarray, "*points 2"],
    interpolation: int = cv2.INTER_LINEAR,
) -> Real[np.ndarray, "..."]:
    """Returns the image at points, in their shape; beyond its border it has the border's values.

    Places are rounded to 1/32 of a pixel (OpenCV); `sample_tensor_at` is exact.

    Args:
        image: The image, with at most four channels, or without an axis of them.
        points_px: The points (x, y), where the center of the first pixel is (0, 0).
        interpolation: OpenCV's number of the interpolation.
    """
    flat = points_px.reshape(-1, 2)
    grid = np.zeros((2, len(flat) // _WIDEST + 1, _WIDEST), dtype=np.float32)
    grid.reshape(2, -1)[:, : len(flat)] = flat.T
    x, y = grid
    sampled = cv2.remap(image, x, y, interpolation, borderMode=cv2.BORDER_REPLICATE)
    channels = image.shape[2:]
    return sampled.reshape(-1, *channels)[: len(flat)].reshape(*points_px.shape[:-1], *channels)
