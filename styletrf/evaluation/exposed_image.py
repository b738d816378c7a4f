"""Gives an image the exposure of another photograph of the same place, for measuring only.

A field has one exposure; a photograph held out has its own, of which nothing in the fit knows. The
exposure that is best for a render is found from the photograph itself (`styletrf.scene.exposures`
has the equation), two numbers a channel, so that the camera causes none of the remaining error.
"""

import numpy as np
from jaxtyping import Bool, Float

from styletrf.evaluation.metrics import Image, mean_squared_error
from styletrf.psnr import psnr_of_error
from styletrf.scene.exposures import MIDDLE

Mask = Bool[np.ndarray, "height width"]

_DARKEST, _BRIGHTEST = 0.03, 0.97  # beyond, rounding and saturation hide the light
_ENOUGH = 64  # pixels
_STEPS = 8
_BOUNDS = (-3.0, 0.2), (3.0, 5.0)  # of log gain and power
_BLACK = 1 / 512


def psnr_exposed(image: Image, photograph: Image, counts: Mask | None = None) -> float:
    """Returns the PSNR of `exposed_as(image, photograph)` in dB, over the pixels that count."""
    exposed = exposed_as(image, photograph, counts)
    return psnr_of_error(mean_squared_error(exposed, photograph, counts))


def exposed_as(image: Image, photograph: Image, counts: Mask | None = None) -> Image:
    """Returns the image in the exposure that makes it most like the photograph.

    In each channel gain and power are those of least squared differences, by Gauss and Newton's
    method over the pixels that are neither dark nor saturated; a channel with few of them, or that
    is not brought nearer, stays as it is.
    """
    whole = np.ones(image.shape[:2], bool) if counts is None else counts
    channels = [_channel(image[..., k], photograph[..., k], whole) for k in range(image.shape[-1])]
    return np.stack(channels, axis=-1)


def _channel(
    image: Float[np.ndarray, "height width"],
    photograph: Float[np.ndarray, "height width"],
    counts: Mask,
) -> Float[np.ndarray, "height width"]:
    usable = (photograph > _DARKEST) & (photograph < _BRIGHTEST) & (image > _DARKEST)
    usable &= counts & (image < _BRIGHTEST)
    if usable.sum() < _ENOUGH:
        return image
    values, wanted = (part[usable].astype(np.float64) for part in (image, photograph))
    logs, found = np.log(values / MIDDLE), np.array([0.0, 1.0])
    for _ in range(_STEPS):
        shown = MIDDLE * np.exp(found[0] + found[1] * logs)
        slopes = np.stack([shown, shown * logs], axis=1)
        step = np.linalg.lstsq(slopes, wanted - shown, rcond=None)[0]
        found = np.clip(found + step, *_BOUNDS)
    scaled = np.maximum(image, _BLACK) / MIDDLE
    exposed = (MIDDLE * np.exp(found[0]) * scaled ** found[1]).clip(0, 1).astype(image.dtype)
    before, after = (np.square(part - photograph)[counts].sum() for part in (image, exposed))
    return exposed if after < before else image
