"""Reads the painting as photographs are read, and checks it."""

import logging
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from styletrf.capture.photographs import read_photograph
from styletrf.errors import InputError
from styletrf.files.images import from_integers
from styletrf.style.perceptual.painting_size import LARGEST_SQUARE_PX
from styletrf.style.style_survey import painting_warnings

_LOGGER = logging.getLogger(__name__)

SMALLEST_SIDE_PX = 64
LONGEST_PROPORTION = 8
"""Only the middle of a painting is used that is longer than this times its shorter side."""

_FLAT_DEVIATION = 0.01  # on [0, 1]: under three levels of 255


def read_style_image(path: Path) -> Float[np.ndarray, "height width 3"]:
    """Returns a painting as RGB float32 in [0, 1], upright, transparent parts over white.

    Of a scroll, longer than eight times its shorter side, only the middle is used, with a warning.
    A painting whose shorter side has more than `LARGEST_SQUARE_PX` pixels is reduced to that.

    Raises:
        InputError: The file is absent, is no whole image, has fewer than 64 pixels a side or too
            many to decode, or shows (nearly) one color, from which no style can be learned.
    """
    if not path.is_file():
        raise InputError(str(path), "there is no such style image", "Give a PNG or JPEG file")
    pixels = read_photograph(path)
    height, width = pixels.shape[:2]
    if min(height, width) < SMALLEST_SIDE_PX:
        raise InputError(
            str(path),
            f"{width}x{height} pixels are too few to learn a style from",
            f"Give an image of at least {SMALLEST_SIDE_PX} pixels a side; 256 or more is better",
        )
    image = from_integers(_reduced(_middle(pixels, path.name)))
    if image.std(axis=(0, 1), dtype=np.float64).max() < _FLAT_DEVIATION:
        remedy = "Give a painting, a drawing or a pattern with visible strokes"
        raise InputError(str(path), "is all one color, or nearly", remedy)
    for warning in painting_warnings(image):
        _LOGGER.warning("%s: %s", path.name, warning)
    return image


def _middle(pixels: UInt8[np.ndarray, "_ _ 3"], name: str) -> UInt8[np.ndarray, "_ _ 3"]:
    """Returns the part of a very long painting that is used."""
    height, width = pixels.shape[:2]
    longest = LONGEST_PROPORTION * min(height, width)
    if max(height, width) <= longest:
        return pixels
    _LOGGER.warning(
        "%s: the painting has %dx%d pixels: only the middle %d pixels of its length are used",
        name, width, height, longest,
    )  # fmt: skip
    top, left = max(0, height - longest) // 2, max(0, width - longest) // 2
    return pixels[top : top + longest, left : left + longest]


def _reduced(pixels: UInt8[np.ndarray, "_ _ 3"]) -> UInt8[np.ndarray, "_ _ 3"]:
    """Returns a painting no larger than it is ever looked at; in float it would take gigabytes."""
    scale = LARGEST_SQUARE_PX / min(pixels.shape[:2])
    if scale >= 1:
        return pixels
    height, width = (round(side * scale) for side in pixels.shape[:2])
    return np.asarray(cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA))
