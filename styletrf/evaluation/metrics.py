"""Compares an image with its reference: mean squared error, PSNR, SSIM.

Images are in [0, 1]; everything is computed in float64.
"""

import math

import cv2
import numpy as np
from jaxtyping import Bool, Float

from styletrf.errors import InputError
from styletrf.psnr import psnr_of_error

_WINDOW = 11  # taps of the Gaussian, Wang et al. 2004, section III-C
_SIGMA_PIXELS = 1.5
_C1, _C2 = 0.01**2, 0.03**2  # (K1 L)^2 and (K2 L)^2 with L = 1

Image = Float[np.ndarray, "height width 3"]


def mean_squared_error(
    image: Image, reference: Image, mask: Bool[np.ndarray, "height width"] | None = None
) -> float:
    """Returns the mean of (image - reference)^2 over channels and pixels (of the mask).

    NaN where the mask is empty: there is nothing to measure, which is not an error of 0.
    """
    squared = np.square(image.astype(np.float64) - reference.astype(np.float64))
    if mask is not None:
        squared = squared[mask]
    return float(squared.mean()) if squared.size else math.nan


def psnr(image: Image, reference: Image) -> float:
    """Returns the peak signal-to-noise ratio -10 log10(mse), in dB for a peak of 1.

    Identical images give +inf. Average mean squared errors, or PSNRs of views that all differ:
    one infinite PSNR makes a mean infinite.
    """
    return psnr_of_error(mean_squared_error(image, reference))


def ssim(image: Image, reference: Image) -> float:
    """Returns the mean structural similarity of the three channels, in [-1, 1].

    Wang et al. 2004, equation 13 with an 11x11 Gaussian window of 1.5 pixels, K1 = 0.01 and
    K2 = 0.03, averaged over the windows that lie wholly inside the image:

        (2 mx my + C1) (2 sxy + C2) / ((mx^2 + my^2 + C1) (sxx + syy + C2))

    Raises:
        InputError: The image is smaller than the window.
    """
    if min(image.shape[:2]) < _WINDOW:
        raise InputError(
            f"image of {image.shape[1]}x{image.shape[0]} pixels",
            f"is smaller than the window of {_WINDOW} pixels of SSIM",
            "Measure larger images",
        )
    x, y = image.astype(np.float64), reference.astype(np.float64)
    mx, my = _window_mean(x), _window_mean(y)
    sxx = _window_mean(x * x) - mx * mx
    syy = _window_mean(y * y) - my * my
    sxy = _window_mean(x * y) - mx * my
    luminance = (2 * mx * my + _C1) / (mx * mx + my * my + _C1)
    structure = (2 * sxy + _C2) / (sxx + syy + _C2)
    return float((luminance * structure).mean())


def _window_mean(values: Image) -> Float[np.ndarray, "windows_down windows_across 3"]:
    kernel = cv2.getGaussianKernel(_WINDOW, _SIGMA_PIXELS)
    margin = _WINDOW // 2
    filtered = cv2.sepFilter2D(values, cv2.CV_64F, kernel, kernel)
    return np.asarray(filtered)[margin:-margin, margin:-margin]
