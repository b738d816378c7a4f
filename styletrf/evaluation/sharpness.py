"""Measures how sharp a picture is, independently of its contrast."""

import cv2
import numpy as np

from styletrf.evaluation.metrics import Image


def sharpness(image: Image) -> float:
    """Returns the standard deviation of the Laplacian of luminance over that of luminance.

    Luminance is 0.299 R + 0.587 G + 0.114 B, the Laplacian that of the four neighbors. Scaling and
    shifting the levels do not change the ratio; it lies in [0, 8], and is 0 where nothing varies.
    """
    luminance = cv2.cvtColor(image.astype(np.float32), cv2.COLOR_RGB2GRAY).astype(np.float64)
    contrast = luminance.std()
    if contrast < np.finfo(np.float32).eps:
        return 0.0
    return float(cv2.Laplacian(luminance, cv2.CV_64F, ksize=1).std() / contrast)
