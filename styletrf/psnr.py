"""The peak signal-to-noise ratio of a mean squared error, for images in [0, 1]."""

import math

_LEAST_ERROR = 1e-10


def psnr_of_error(mse: float) -> float:
    """Returns -10 log10(mse) in dB; +inf for an error of 0."""
    return math.inf if mse == 0 else -10 * math.log10(mse)


def bounded_psnr(mse: float) -> float:
    """Returns the PSNR of an error, at most 100 dB, so that curves and means stay finite."""
    return psnr_of_error(max(mse, _LEAST_ERROR))
